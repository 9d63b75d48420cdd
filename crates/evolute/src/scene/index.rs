//! Named indices of refraction: transparent media and metals.

use crate::geometry::Rgb;

use super::message::{Checked, Complaint, listed, nearest, quoted};

use super::text::Text;

/// Media and their real index at 589.29 nm, 20 °C or 25 °C, gases at 0 °C and 1 atm: the names and
/// values of Mitsuba 3, as read back from version 3.9.1.
const MEDIA: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000036),
    ("hydrogen", 1.000132),
    ("air", 1.000277),
    ("carbon dioxide", 1.00045),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.52045),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// A material's name, whether `name_palik` means the same, and η and k for red, green and blue.
type Metal = (&'static str, bool, [f64; 3], [f64; 3]);

/// Metals and other absorbers: what Mitsuba 3.9.1's RGB variants make of the spectra it comes with
/// (measurements of several authors, most by way of Palik, "Handbook of Optical Constants of
/// Solids"), read back from the loaded plugin to five digits.
#[rustfmt::skip]
const METALS: [Metal; 41] = [
    ("Ag", false, [0.15528, 0.11673, 0.13839], [4.8284, 3.1222, 2.1469]),
    ("Al", false, [1.6575, 0.8804, 0.52124], [9.2238, 6.2695, 4.837]),
    ("AlAs", true, [3.6053, 3.2329, 2.2163], [0.00067944, 0.0, 0.0075127]),
    ("AlSb", true, [0.0, 4.1394, 4.6693], [0.0, 0.094009, 1.3006]),
    ("Au", false, [0.14304, 0.37531, 1.442], [3.983, 2.3856, 1.6034]),
    ("Be", true, [4.185, 3.185, 2.7841], [3.8355, 3.0101, 2.869]),
    ("Cr", false, [4.3697, 2.9165, 1.6549], [5.2065, 4.2313, 3.7547]),
    ("CsI", true, [2.1449, 1.7023, 1.6624], [0.0, 0.0, 0.0]),
    ("Cu", false, [0.20101, 0.92375, 1.1022], [3.9133, 2.453, 2.1421]),
    ("Cu2O", true, [3.5518, 2.9499, 2.7519], [0.11421, 0.1939, 0.60613]),
    ("CuO", true, [3.2475, 2.4478, 2.2102], [0.52109, 0.57003, 0.72218]),
    ("Cu_palik", false, [0.21323, 0.91972, 1.1024], [3.9219, 2.4573, 2.1366]),
    ("Hg", true, [2.3989, 1.44, 0.90957], [6.3276, 4.3719, 3.4218]),
    ("HgTe", true, [4.779, 3.2312, 2.6599], [1.6316, 1.5808, 1.7293]),
    ("Ir", true, [3.0863, 2.0822, 1.6179], [5.5922, 4.0671, 3.2673]),
    ("K", true, [0.064043, 0.04641, 0.038185], [2.1042, 1.3489, 0.91313]),
    ("Li", true, [0.26579, 0.19562, 0.22095], [3.5402, 2.3111, 1.6686]),
    ("MgO", true, [2.0896, 1.6507, 1.5949], [0.000000000004, 0.0, 0.000000000025]),
    ("Mo", true, [4.484, 3.5251, 2.7763], [4.1114, 3.4208, 3.1506]),
    ("Na_palik", false, [0.060269, 0.056141, 0.061988], [3.1793, 2.1125, 1.579]),
    ("Nb", true, [3.4201, 2.7901, 2.3956], [3.4414, 2.7377, 2.5797]),
    ("Ni_palik", false, [2.3673, 1.6634, 1.4671], [4.4988, 3.0502, 2.3454]),
    ("Rh", true, [2.5858, 1.8602, 1.5543], [6.7823, 4.703, 3.9761]),
    ("Se", true, [4.0583, 2.8429, 2.8209], [0.75405, 0.63844, 0.52181]),
    ("Se-e", true, [5.7228, 4.1657, 4.0813], [0.87114, 1.1052, 1.5653]),
    ("SiC", true, [3.1723, 2.526, 2.4794], [0.00000075377, 0.0, 0.000010193]),
    ("SnTe", true, [4.5242, 1.9816, 1.2816], [0.0, 0.0, 0.0]),
    ("Ta", true, [2.0627, 2.3929, 2.6279], [2.4084, 1.7415, 1.947]),
    ("Te", true, [7.3902, 4.4821, 2.6371], [3.256, 3.5271, 3.2921]),
    ("Te-e", true, [7.5089, 4.2964, 2.37], [5.5839, 4.9472, 3.9976]),
    ("ThF4", true, [1.8307, 1.4422, 1.3876], [0.0, 0.0, 0.0]),
    ("TiC", true, [3.7005, 2.8374, 2.5823], [3.2656, 2.3516, 2.1728]),
    ("TiN", true, [1.6484, 1.1505, 1.3798], [3.3683, 1.9435, 1.1021]),
    ("TiO2", true, [3.4566, 2.8017, 2.9052], [0.00010526, 0.0, 0.00065289]),
    ("TiO2-e", true, [3.1066, 2.5132, 2.5824], [0.000029752, 0.0, 0.0001827]),
    ("VC", true, [3.6576, 2.7527, 2.5327], [3.0683, 2.1987, 1.9632]),
    ("VN", true, [2.8656, 2.1192, 1.9401], [3.0322, 2.0561, 1.6163]),
    ("V_palik", false, [4.2776, 3.5129, 2.7611], [3.4913, 2.8895, 3.1115]),
    ("W", false, [4.3708, 3.3002, 2.9984], [3.5006, 2.6049, 2.2732]),
    ("a-C", false, [2.944, 2.2271, 1.9682], [0.88746, 0.7993, 0.81529]),
    ("d-C", true, [2.7087, 2.3188, 2.2289], [0.0, 0.0, 0.0]),
];

/// The index of a medium, by its name in any case.
///
/// # Errors
/// An unknown name.
pub(super) fn dielectric(name: &Text) -> Checked<f64> {
    let wanted = name.value.trim().to_lowercase();
    MEDIA.iter().find(|(n, _)| *n == wanted).map(|(_, index)| *index).ok_or_else(|| {
        let complaint =
            Complaint::at(name.span, format!("no medium is called {}", quoted(&name.value)));
        if wanted.parse::<f64>().is_ok() {
            return complaint.help("a number is a <float>, not a <string>");
        }
        let known = listed(MEDIA.iter().map(|m| m.0), "and");
        complaint
            .maybe_meant(nearest(&wanted, MEDIA.iter().map(|m| m.0)))
            .help(format!("known are {known}; or give a number"))
    })
}

/// η and k of a material, by its name.
///
/// # Errors
/// An unknown name.
pub(super) fn conductor(name: &Text) -> Checked<(Rgb, Rgb)> {
    let wanted = name.value.trim();
    let found = METALS.iter().find(|m| m.0 == wanted).or_else(|| {
        let base = wanted.strip_suffix("_palik")?;
        METALS.iter().find(|m| m.0 == base && m.1)
    });
    found.map(|(_, _, eta, k)| (Rgb(*eta), Rgb(*k))).ok_or_else(|| {
        Complaint::at(name.span, format!("no conductor is called {}", quoted(wanted)))
            .maybe_meant(nearest(wanted, METALS.iter().map(|m| m.0).chain(["none"])))
            .help("give \"eta\" and \"k\" instead, or \"none\" for a perfect mirror")
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::source::Span;
    use super::*;

    fn text(name: &str) -> Text {
        Text::constant(name, Span { file: 0, start: 0, end: 0 })
    }

    /// Mitsuba 3.9.1: `dielectric` without properties has η = 1.5041833, `water` in air 1.3326308.
    #[test]
    fn media_are_mitsuba_s() {
        let ratio =
            |a: &str, b: &str| dielectric(&text(a)).unwrap() / dielectric(&text(b)).unwrap();
        // Mitsuba's are single-precision quotients of single-precision numbers.
        assert!((ratio("bk7", "air") - 1.504183292388916).abs() < 2.4e-7);
        assert!((ratio("Water", "air") - 1.3326307535171509).abs() < 2.4e-7);
        assert!(dielectric(&text("wter")).is_err());
    }

    #[test]
    fn metals_are_found_by_both_their_names() {
        assert_eq!(conductor(&text("Au")).unwrap().0, Rgb([0.14304, 0.37531, 1.442]));
        assert_eq!(conductor(&text("Hg_palik")).unwrap(), conductor(&text("Hg")).unwrap());
        assert_ne!(conductor(&text("Cu_palik")).unwrap(), conductor(&text("Cu")).unwrap());
        for name in ["au", "Al_palik", "none", ""] {
            assert!(conductor(&text(name)).is_err(), "{name}");
        }
    }
}
