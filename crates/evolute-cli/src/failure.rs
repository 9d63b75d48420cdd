//! How a run can end other than well.

use std::path::PathBuf;

/// What went wrong, by exit status.
#[derive(Debug)]
pub enum Failure {
    /// 1: the input is wrong, or the output cannot be written. Nothing was written.
    Input(String),
    /// 2: the command line asks for what cannot be.
    Usage(String),
    /// 3: a limit of the user's came before the accuracy was met. The result is written.
    Limit(String),
    /// 130: Ctrl-C. Nothing was written.
    Interrupted,
    /// 130: Ctrl-C. What was done is in this file.
    Kept(PathBuf),
}

impl Failure {
    /// The exit status.
    pub fn status(&self) -> u8 {
        match self {
            Self::Input(_) => 1,
            Self::Usage(_) => 2,
            Self::Limit(_) => 3,
            Self::Interrupted | Self::Kept(_) => 130,
        }
    }

    /// What to tell the user.
    pub fn message(&self) -> String {
        match self {
            Self::Input(_) | Self::Usage(_) | Self::Limit(_) => format!("error: {}", self.text()),
            Self::Interrupted | Self::Kept(_) => self.text(),
        }
    }

    /// The same for a field that is called `error`.
    pub fn text(&self) -> String {
        match self {
            Self::Input(text) | Self::Usage(text) | Self::Limit(text) => {
                // Messages that quote the scene start with that themselves.
                let text = text.trim_end();
                text.strip_prefix("error: ").unwrap_or(text).into()
            }
            Self::Interrupted => "interrupted; nothing was written".into(),
            Self::Kept(path) => format!(
                "interrupted; what was done is kept in '{}': repeat the command with --resume to go on",
                path.display()
            ),
        }
    }
}

impl From<evolute::output::OutputError> for Failure {
    fn from(e: evolute::output::OutputError) -> Self {
        Self::Input(match e {
            evolute::output::OutputError::File { .. } => {
                format!("{e}; make that place writable, or choose another with -o")
            }
            evolute::output::OutputError::Format(_) => e.to_string(),
        })
    }
}
