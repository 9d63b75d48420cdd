//! Options that every verb takes.

use std::time::Duration;

use clap::Args;

/// The common options.
#[derive(Args, Debug)]
pub struct Common {
    /// Tolerance at a receiver, as a fraction of its irradiance
    #[arg(short = 'a', long, value_name = "R", default_value_t = 0.01, value_parser = fraction,
          allow_hyphen_values = true,
          help_heading = "Accuracy")]
    pub accuracy: f64,
    /// Tolerance below which the relative one does not fall [W/m²] [default: R/1000 of the emitted
    /// flux over the total surface area]
    #[arg(long, value_name = "A", value_parser = not_negative, allow_hyphen_values = true,
          help_heading = "Accuracy")]
    pub accuracy_abs: Option<f64>,
    /// Longest specular chain that is wanted, in interactions, at most 256 [default: until the
    /// throughput falls below the accuracy, and at most 256; what that cuts counts in the error]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256),
          allow_negative_numbers = true, help_heading = "Accuracy")]
    pub max_specular: Option<u32>,
    /// Stop after so many seconds; what is done until then is written with what its error is by then,
    /// and the exit status is 3
    #[arg(long, value_name = "S", value_parser = seconds, allow_hyphen_values = true,
          help_heading = "Accuracy")]
    pub max_time: Option<Duration>,
    /// Most iterations of the radiosity solution; direct and specular light need none
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Accuracy")]
    pub max_iterations: Option<u64>,
    /// Set $NAME in the scene, as in Mitsuba
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = definition)]
    pub define: Vec<(String, String)>,
    /// Number of threads (more than 256 count as 256); the result does not depend on it [default: all cores]
    #[arg(short = 't', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..),
          allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Give results in lm, lx and cd/m²: 683 lm for a watt
    #[arg(long)]
    pub photometric: bool,
    /// Print errors only
    #[arg(short = 'q', long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say what is done and how long it takes
    #[arg(short = 'v', long)]
    pub verbose: bool,
    /// Print one JSON object on standard output at the end: timings in s, counts of chains, rays and
    /// receivers, the largest estimated error, files written; of a radiosity solution its iterations and its energy
    /// ledger
    #[arg(long)]
    pub json: bool,
}

impl Common {
    /// The units of flux, irradiance and radiance in results.
    pub fn units(&self) -> [&'static str; 3] {
        if self.photometric { ["lm", "lx", "cd/m²"] } else { ["W", "W/m²", "W/(m² sr)"] }
    }

    /// Factor on watts in results.
    pub fn unit_factor(&self) -> f64 {
        if self.photometric { 683.0 } else { 1.0 }
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_infinite() => Err("it must be a finite number".into()),
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("not a number".into()),
    }
}

fn fraction(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if x > 0.0 && x <= 1.0 => Ok(x),
        _ => Err("it must be more than 0 and at most 1".into()),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match number(text)? {
        x if x >= 0.0 => Ok(x),
        _ => Err("it must not be negative".into()),
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    const TOO_LONG: &str = "it is too long; without --max-time there is no limit";
    if text.parse() == Ok(f64::INFINITY) {
        return Err(TOO_LONG.into());
    }
    Duration::try_from_secs_f64(not_negative(text)?).map_err(|_| TOO_LONG.into())
}

fn definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.into(), value.into())),
        _ => Err("write NAME=VALUE".into()),
    }
}

/// `640x480`
pub fn size(text: &str) -> Result<(u32, u32), String> {
    const LARGEST: u32 = 32_768;
    // As for a scene's film; while they are made, so many pixels take some 16 GiB.
    const MOST_PIXELS: u64 = 1 << 26;
    let parse = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=LARGEST).contains(n));
    let (width, height) = text
        .split_once(['x', 'X', '×'])
        .and_then(|(w, h)| Some((parse(w)?, parse(h)?)))
        .ok_or_else(|| format!("write WIDTHxHEIGHT, each from 1 to {LARGEST}"))?;
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(format!("that is too large: at most {MOST_PIXELS} pixels in all"));
    }
    Ok((width, height))
}

/// A finite number of stops.
pub fn stops(text: &str) -> Result<f64, String> {
    // Beyond these the factor leaves single precision.
    match number(text)? {
        x if x.abs() <= 100.0 => Ok(x),
        _ => Err("it must lie between -100 and 100".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        for wrong in ["640", "x480", "0x10", "10x-1", "99999x1", "9000x9000", "axb", ""] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers() {
        assert_eq!(fraction("1e-3"), Ok(1e-3));
        for wrong in ["0", "-1", "2", "nan", "inf", "x"] {
            assert!(fraction(wrong).is_err(), "{wrong}");
        }
        assert!(seconds("inf").is_err_and(|e| e.contains("no limit")));
        assert!(seconds("1e300").is_err() && seconds("-1").is_err() && seconds("0.5").is_ok());
        assert_eq!(definition("a=b=c"), Ok(("a".into(), "b=c".into())));
        assert!(definition("=b").is_err() && definition("ab").is_err());
        assert_eq!(stops("-1.5"), Ok(-1.5));
    }
}
