//! From radiance to the display.

use crate::geometry::math;

/// How scene radiance becomes display brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Radiance is multiplied by 2^`ev`; a product of one is shown at three quarters of the
    /// display's linear brightness.
    pub ev: f64,
}

/// Display values up to here are proportional to radiance; above, highlights are compressed. A half
/// in linear light is about three quarters of the way to white for the eye, so most of a well
/// exposed picture is left alone, and a caustic ten times as bright as white paper still differs
/// from one of twice that.
const KNEE: f64 = 0.5;

/// Share of pixels that the automatic exposure lets rise above the level of white paper: lamps and
/// the cores of caustics, seldom more.
const BRIGHT_SHARE: f64 = 0.1;

/// Where the automatic exposure puts the brightest of the other pixels: white paper of
/// reflectance 0.8.
const PAPER: f64 = 0.8;

impl Exposure {
    /// The exposure that shows the picture `rgb` (linear, one triple of channels) well: all but its
    /// brightest tenth are at most as bright as paper. Rounded to a twentieth, so that it can be
    /// repeated by hand. Black pictures get 0.
    pub fn automatic(rgb: [&[f32]; 3]) -> Self {
        let brightest = |i: usize| rgb[0][i].max(rgb[1][i]).max(rgb[2][i]);
        let mut values: Vec<f32> =
            (0..rgb[0].len()).map(brightest).filter(|x| *x > 0.0 && x.is_finite()).collect();
        values.sort_unstable_by(f32::total_cmp);
        // An index, so the cast cannot leave the range.
        let Some(level) = values.get((values.len() as f64 * (1.0 - BRIGHT_SHARE)) as usize) else {
            return Self { ev: 0.0 };
        };
        let ev = math::log(PAPER / f64::from(*level)) / std::f64::consts::LN_2;
        Self { ev: (ev * 20.0).round() / 20.0 }
    }

    /// The factor on radiance.
    pub fn factor(&self) -> f64 {
        math::pow(2.0, self.ev)
    }
}

/// Linear scene values (already multiplied by the exposure) as sRGB display values in 0 ..= 255.
///
/// Proportional up to a half; above, the largest channel is bent towards one and the others keep
/// their ratio to it, so that a highlight neither clips nor changes its hue.
pub fn display_rgb(linear: [f64; 3]) -> [u8; 3] {
    let linear = linear.map(|x| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1e30) });
    let largest = linear[0].max(linear[1]).max(linear[2]);
    let scale = if largest > KNEE { shoulder(largest) / largest } else { 1.0 };
    linear.map(|x| (255.0 * srgb(x * scale)).round() as u8)
}

/// Bends `x` > [`KNEE`] towards one; value and slope continue the straight line.
fn shoulder(x: f64) -> f64 {
    let room = 1.0 - KNEE;
    let over = x - KNEE;
    KNEE + room * over / (over + room)
}

/// The transfer function of IEC 61966-2-1 for x in [0, 1].
fn srgb(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * math::pow(x, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_display_values() {
        // IEC 61966-2-1: linear 0.2140411 is 127.5 / 255.
        assert_eq!(display_rgb([0.0; 3]), [0; 3]);
        assert_eq!(display_rgb([0.2159; 3]), [128; 3]);
        assert_eq!(display_rgb([f64::NAN, -1.0, 0.0]), [0; 3]);
        assert_eq!(display_rgb([f64::INFINITY; 3]), [255; 3]);
    }

    #[test]
    fn highlights_keep_order_and_hue() {
        let mut last = 0;
        for x in [0.1, 0.5, 0.6, 1.0, 2.0, 5.0, 10.0, 20.0] {
            let [r, g, b] = display_rgb([x, 0.5 * x, 0.25 * x]);
            assert!(r > last, "{x}");
            last = r;
            // Ratios in linear light survive up to the rounding to 8 bits.
            let back = |v: u8| {
                let v = f64::from(v) / 255.0;
                if v <= 0.04045 { v / 12.92 } else { math::pow((v + 0.055) / 1.055, 2.4) }
            };
            assert!((back(g) / back(r) - 0.5).abs() < 0.02);
            assert!((back(b) / back(r) - 0.25).abs() < 0.02);
        }
    }

    #[test]
    fn automatic_exposure_leaves_the_brightest_tenth_out() {
        let mut values = vec![3.0f32; 95];
        values.extend([1000.0; 5]);
        let e = Exposure::automatic([&values, &values, &values]);
        assert!((e.factor() * 3.0 - PAPER).abs() < 0.03, "{e:?}");
        assert_eq!(Exposure::automatic([&[0.0], &[0.0], &[0.0]]).ev, 0.0);
    }
}
