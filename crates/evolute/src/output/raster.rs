//! A picture as named channels.

/// One value per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `layer.X`, or `X` in the unnamed layer.
    pub name: String,
    /// Row by row from the top, each from left to right.
    pub values: Vec<f32>,
}

/// Channels of one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Raster {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The channels; the order carries no meaning.
    pub channels: Vec<Channel>,
}

impl Raster {
    /// An empty picture of the given size.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, channels: Vec::new() }
    }

    /// Adds a channel of one value per pixel, row by row.
    pub fn push(&mut self, name: impl Into<String>, values: Vec<f32>) {
        self.channels.push(Channel { name: name.into(), values });
    }

    /// Adds `R`, `G`, `B` of a layer (`""`: the unnamed one) from one triple per pixel.
    pub fn push_rgb(&mut self, layer: &str, values: impl Iterator<Item = [f32; 3]> + Clone) {
        for (i, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let name = if layer.is_empty() { letter.into() } else { format!("{layer}.{letter}") };
            self.push(name, values.clone().map(|v| v[i]).collect());
        }
    }

    /// The channel of a name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// The three channels of a layer, in the order R, G, B.
    pub fn rgb(&self, layer: &str) -> Option<[&[f32]; 3]> {
        let name = |c: &str| if layer.is_empty() { c.into() } else { format!("{layer}.{c}") };
        Some([self.channel(&name("R"))?, self.channel(&name("G"))?, self.channel(&name("B"))?])
    }

    /// Whether every channel has width × height values, and no name occurs twice.
    pub(super) fn check(&self) -> Result<(), super::OutputError> {
        let refuse = |text: String| Err(super::OutputError::Format(text));
        if self.width == 0 || self.height == 0 {
            return refuse(format!(
                "a picture of {} × {} pixels is empty",
                self.width, self.height
            ));
        }
        for (i, c) in self.channels.iter().enumerate() {
            if c.values.len() != self.width * self.height {
                return refuse(format!(
                    "channel '{}' has {} values; {} × {} pixels need {}",
                    c.name,
                    c.values.len(),
                    self.width,
                    self.height,
                    self.width * self.height
                ));
            }
            if self.channels[..i].iter().any(|d| d.name == c.name) {
                return refuse(format!("two channels are called '{}'", c.name));
            }
        }
        Ok(())
    }
}
