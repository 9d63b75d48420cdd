//! How long runs are watched and stopped.

/// Whether to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Yes.
    Go,
    /// No, but make a picture of what is there.
    Finish,
    /// No, and nothing is wanted.
    Abandon,
}

/// How a run is watched and stopped. Both functions are called often, from one thread or several.
#[derive(Clone, Copy)]
pub struct Control<'c> {
    /// Asked between steps of some milliseconds.
    pub order: &'c (dyn Fn() -> Order + Sync),
    /// Told how much of the present stage is done: (its name, done, of how many).
    pub progress: &'c (dyn Fn(&'static str, u64, u64) + Sync),
}

impl Control<'_> {
    /// Goes on to the end, unwatched.
    pub const GO: Control<'static> = Control { order: &|| Order::Go, progress: &|_, _, _| {} };
}
