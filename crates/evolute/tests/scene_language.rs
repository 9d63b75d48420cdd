//! Scenes that are right: what their text means, with Mitsuba 3.9.1's answers to the same text where
//! it has any (variant scalar_rgb; single precision, so to six digits).
#![allow(clippy::unwrap_used, missing_docs)]

use std::f64::consts::PI;

use evolute::scene::{Loaded, load_str};

/// A scene with this inside.
fn load(inside: &str) -> Loaded {
    let text = format!("<scene version=\"3.0.0\">{inside}</scene>");
    load_str("test.xml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// A flat surface that folds over itself, and whose middle lies on a fold: area elements change
/// sign along lines all over the domain. ∫ |sin| and ∫ |cos| over half periods are 2/π of their width.
#[test]
fn a_folded_surface_loads_and_has_its_area() {
    let start = std::time::Instant::now();
    let loaded = load(
        "<shape type=\"parametric\">
           <string name=\"x\" value=\"0*s\"/>
           <string name=\"y\" value=\"-5*cos(3*pi*(s-0.5))*cos(3*pi*(t-0.5))\"/>
           <string name=\"z\" value=\"100*(0.5-t)\"/>
         </shape>",
    );
    let area = loaded.scene.shapes[0].surface.area();
    let exact = 5.0 * 3.0 * PI * 100.0 * (2.0 / PI) * (2.0 / PI);
    assert!((area / exact - 1.0).abs() < 1e-4, "{area}, not {exact}");
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}
