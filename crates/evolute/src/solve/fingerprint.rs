//! Checksums, and whether a scene is the one that a solution was made for.

use std::fmt::{self, Write};

use crate::scene::Scene;

/// Fowler, Noll and Vo's hash FNV-1a of 128 bits: two inputs that differ by accident have the same one time in 2¹²⁸. It is
/// no proof against someone who wants them to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hash(u128);

const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;

impl Hash {
    pub fn new() -> Self {
        Self(OFFSET)
    }

    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u128::from(*byte)).wrapping_mul(PRIME);
        }
    }

    pub fn value(self) -> u128 {
        self.0
    }
}

impl Write for Hash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add(text.as_bytes());
        Ok(())
    }
}

/// A scene's fingerprint: of all that light depends on, shapes in their order, where they are, their materials and what
/// they emit. Names, sensors and `max_depth` do not count: pictures from several places share a solution.
pub(super) fn fingerprint(scene: &Scene) -> u128 {
    let mut hash = Hash::new();
    for shape in &scene.shapes {
        // Numbers in this form read back to the same bits, so that different scenes have different texts.
        let (surface, material) = (&shape.surface, &shape.material);
        let written = write!(hash, "{surface:?}\n{material:?}\n{:?}\n", shape.radiance);
        debug_assert!(written.is_ok(), "a hash takes any text");
    }
    hash.value()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::load_str;

    #[test]
    fn hashes_of_the_authors_examples() {
        let hash = |text: &str| {
            let mut hash = Hash::new();
            hash.add(text.as_bytes());
            hash.value()
        };
        assert_eq!(hash(""), OFFSET);
        assert_eq!(hash("a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
        assert_eq!(hash("foobar"), 0x343e_1662_793c_64bf_6f0d_3597_ba44_6f18);
    }

    #[test]
    fn what_light_depends_on_counts() {
        let text = r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="40"/></sensor>
            <shape type="sphere" id="ball"><float name="radius" value="1"/><bsdf type="diffuse"/></shape>
            <shape type="rectangle"><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
            <shape type="parametric"><string name="x" value="s"/><string name="y" value="t"/>
            <string name="z" value="2 + s*t"/></shape></scene>"#;
        let of = |text: &str| fingerprint(&load_str("test.xml", text, &[]).unwrap().scene);
        let own = of(text);
        assert_eq!(own, of(text));
        for (old, new) in [("\"ball\"", "\"orb\""), ("value=\"40\"", "value=\"50\""), ("> ", ">\n")]
        {
            assert_eq!(own, of(&text.replace(old, new)), "{new}");
        }
        for (old, new) in [
            ("radius\" value=\"1\"", "radius\" value=\"1.0000000000000002\""),
            ("radiance\" value=\"1\"", "radiance\" value=\"1, 1, 2\""),
            ("2 + s*t", "2 + t*t"),
            ("2 + s*t", "3 + s*t"),
            ("diffuse", "conductor"),
        ] {
            assert_ne!(own, of(&text.replace(old, new)), "{new}");
        }
    }
}
