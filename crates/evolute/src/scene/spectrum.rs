//! Colours: `rgb` and `spectrum` values, and what a spectrum is in linear Rec. 709.

use crate::geometry::Rgb;

use super::cie;
use super::description::Spectrum;
use super::message::{Checked, Complaint, quoted};
use super::number;
use super::text::Text;

/// Longest file with a spectrum [bytes]; measured ones have a few kilobytes.
pub(super) const MAX_TABLE_BYTES: u64 = 1 << 20;

/// Three numbers, or one for all channels.
///
/// # Errors
/// Anything else; a `#rrggbb` is answered with the linear values it stands for.
pub(super) fn rgb(text: &Text) -> Checked<[f64; 3]> {
    let value = text.value.trim();
    if let Some(hex) = value.strip_prefix('#') {
        // Mitsuba 3 does not take them either: whether 8-bit values are meant linearly or not is
        // exactly what goes wrong with them.
        let complaint = Complaint::at(text.span, "a colour is three linear values, not #rrggbb");
        return Err(match from_hex(hex) {
            Some([r, g, b]) => {
                complaint.help(format!("for {} write \"{r:.4}, {g:.4}, {b:.4}\"", quoted(value)))
            }
            None => complaint,
        });
    }
    number::triple(text)
}

/// Linear values of an sRGB `rrggbb` (IEC 61966-2-1).
fn from_hex(hex: &str) -> Option<[f64; 3]> {
    let digits = u32::from_str_radix(hex, 16).ok().filter(|_| hex.len() == 6)?;
    Some([16, 8, 0].map(|shift| {
        let v = f64::from(digits >> shift & 0xff) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { crate::geometry::math::pow((v + 0.055) / 1.055, 2.4) }
    }))
}

/// One number, or `wavelength:value` pairs.
///
/// # Errors
/// Anything else.
pub(super) fn spectrum(text: &Text) -> Checked<Spectrum> {
    if !text.value.contains(':') {
        let numbers = number::list(text, 1).map_err(|complaint| {
            complaint.help("write one number for all wavelengths, or pairs: \"400:0.1, 700:0.2\"")
        })?;
        return match numbers.as_slice() {
            [value] => Ok(Spectrum::Uniform(*value)),
            _ => number::float(text).map(Spectrum::Uniform),
        };
    }
    let mut samples = Vec::new();
    for range in number::words(&text.value) {
        let word = &text.value[range.clone()];
        let Some(colon) = word.find(':') else {
            return Err(Complaint::at(
                text.locate(range),
                format!("{} is no wavelength:value pair", quoted(word)),
            )
            .help("write pairs such as \"400:0.1, 500:0.5, 700:0.2\", wavelengths in nanometres"));
        };
        let middle = range.start + colon;
        let wavelength = number::float_in(text, range.start..middle)?;
        let value = number::float_in(text, middle + 1..range.end)?;
        push(&mut samples, wavelength, value)
            .map_err(|why| Complaint::at(text.locate(range), why))?;
    }
    enough(samples).map_err(|why| Complaint::at(text.span, why))
}

/// A file with one `wavelength value` pair a line; `#` begins a comment.
///
/// # Errors
/// Anything else, with the line.
pub(super) fn table(content: &str, name: &Text) -> Checked<Spectrum> {
    let mut samples = Vec::new();
    for (i, line) in content.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        let say = |why: String| {
            Complaint::at(name.span, format!("{}, line {}: {why}", name.value, i + 1))
        };
        let numbers: Option<Vec<f64>> = number::words(line)
            .map(|r| line[r].parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        match numbers.as_deref() {
            Some([wavelength, value]) => push(&mut samples, *wavelength, *value).map_err(say)?,
            _ => {
                return Err(say(format!(
                    "{} is no pair of a wavelength and a value",
                    quoted(line)
                )));
            }
        }
    }
    enough(samples).map_err(|why| Complaint::at(name.span, format!("{}: {why}", name.value)))
}

fn push(samples: &mut Vec<(f64, f64)>, wavelength: f64, value: f64) -> Result<(), String> {
    if wavelength <= samples.last().map_or(0.0, |s| s.0) {
        return Err("wavelengths [nm] must be positive and increase".to_string());
    }
    samples.push((wavelength, value));
    Ok(())
}

fn enough(samples: Vec<(f64, f64)>) -> Result<Spectrum, String> {
    if samples.len() < 2 {
        return Err("a spectrum of pairs needs two at least".to_string());
    }
    Ok(Spectrum::Samples(samples))
}

/// What a spectrum is the spectrum of, which decides how it becomes a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// A reflectance or an index: seen under D65, so that a uniform one is grey.
    Factor,
    /// Power: a uniform one is the equal-energy white, which is not grey in Rec. 709.
    Power,
}

/// A spectrum in linear Rec. 709; negative channels (colours outside the gamut) become 0, as in
/// Mitsuba 3. It is zero beyond its first and last sample.
pub(super) fn colour(spectrum: &Spectrum, quantity: Quantity) -> Rgb {
    let weighted = |value: &dyn Fn(f64) -> f64| integrate(value, quantity);
    let white = integrate(&|_| 1.0, Quantity::Factor);
    let integral = match (spectrum, quantity) {
        (Spectrum::Uniform(value), Quantity::Factor) => return Rgb::grey(*value),
        (Spectrum::Uniform(value), Quantity::Power) => weighted(&|_| *value),
        (Spectrum::Samples(samples), _) => weighted(&|wavelength| interpolate(samples, wavelength)),
    };
    let rgb = rec709(integral);
    // Under D65 the white of Rec. 709 itself, to the tables' last digit.
    let scale = if quantity == Quantity::Factor { rec709(white) } else { [1.0; 3] };
    Rgb(std::array::from_fn(|i| (rgb[i] / scale[i]).max(0.0)))
}

/// XYZ of a spectrum, Y = 1 for the uniform 1.
fn integrate(value: &dyn Fn(f64) -> f64, quantity: Quantity) -> [f64; 3] {
    // Nanometre by nanometre: five times finer than the tables, so that spectra with a few sharp
    // steps lose nothing.
    const SUB: usize = 5;
    let mut sum = [0.0; 3];
    let mut norm = 0.0;
    for step in 0..(cie::TABLE.len() - 1) * SUB {
        // Midpoints: the ends, where everything is zero, need no care.
        let position = (step as f64 + 0.5) / SUB as f64;
        let (i, w) = (step / SUB, position - (step / SUB) as f64);
        let row: [f64; 4] =
            std::array::from_fn(|k| cie::TABLE[i][k] * (1.0 - w) + cie::TABLE[i + 1][k] * w);
        let light = if quantity == Quantity::Factor { row[3] } else { 1.0 };
        let power = light * value(cie::FIRST + cie::STEP * position);
        for k in 0..3 {
            sum[k] += row[k] * power;
        }
        norm += row[1] * light;
    }
    sum.map(|x| x / norm)
}

/// Linear between samples, zero outside.
fn interpolate(samples: &[(f64, f64)], wavelength: f64) -> f64 {
    let after = samples.partition_point(|s| s.0 <= wavelength);
    match (after.checked_sub(1).and_then(|i| samples.get(i)), samples.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * ((wavelength - a.0) / (b.0 - a.0)),
        (Some(a), None) if a.0 == wavelength => a.1,
        _ => 0.0,
    }
}

/// XYZ → linear Rec. 709 (ITU-R BT.709 primaries, white D65).
fn rec709([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240479 * x - 1.537150 * y - 0.498535 * z,
        -0.969256 * x + 1.875991 * y + 0.041556 * z,
        0.055648 * x - 0.204043 * y + 1.057311 * z,
    ]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn parsed(text: &str) -> Spectrum {
        let span = super::super::source::Span { file: 0, start: 0, end: text.len() as u32 };
        spectrum(&Text::constant(text, span)).unwrap()
    }

    fn near(spectrum: &str, quantity: Quantity, expected: [f64; 3]) {
        let got = colour(&parsed(spectrum), quantity);
        for i in 0..3 {
            // Mitsuba sums 1000 samples over 999 steps and is 1e-3 low by that alone.
            let tolerance = 2e-3 * expected[i].abs().max(0.1);
            assert!(
                (got[i] - expected[i]).abs() < tolerance,
                "{spectrum}: {got:?}, not {expected:?}"
            );
        }
    }

    /// Figures of Mitsuba 3.9.1, variant scalar_rgb, read back from the loaded plugins.
    #[test]
    fn spectra_become_mitsuba_s_colours() {
        use Quantity::{Factor, Power};
        near("400:0.3, 700:0.3", Factor, [0.2986026, 0.2999269, 0.2984727]);
        near("300:0.3 900:0.3", Factor, [0.3, 0.3, 0.3]);
        near("400:0.1 500:0.2 600:0.8 700:.9", Factor, [0.9586895, 0.4463556, 0.1057104]);
        near("400:1.5 500:2 600:.3 700:.1", Factor, [0.0, 1.3302397, 1.8502280]);
        near("400:1.5 500:2 600:4 700:5", Factor, [4.6578250, 2.8167391, 1.5915107]);
        near("3", Power, [3.6143818, 2.8448730, 2.7267482]);
        near("400:3, 700:3", Power, [3.5990808, 2.8485610, 2.7103300]);
        near("400:0.1 500:0.2 600:0.8 700:.9", Power, [1.1035471, 0.4287319, 0.0887223]);
    }

    #[test]
    fn uniform_power_keeps_its_luminance() {
        assert!((colour(&parsed("2"), Quantity::Power).luminance() - 2.0).abs() < 1e-4);
        assert_eq!(colour(&parsed("0.25"), Quantity::Factor), Rgb::grey(0.25));
        for channel in colour(&parsed("300:0.4 900:0.4"), Quantity::Factor).0 {
            assert!((channel - 0.4).abs() < 1e-12);
        }
    }

    #[test]
    fn srgb_bytes_are_linearised_for_the_message() {
        let [r, g, b] = from_hex("ff8000").unwrap();
        assert!((r - 1.0).abs() < 1e-15 && (g - 0.2158605).abs() < 1e-6 && b == 0.0);
        assert!(from_hex("f80").is_none() && from_hex("ff80zz").is_none());
    }
}
