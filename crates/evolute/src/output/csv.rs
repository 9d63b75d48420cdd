//! Comma-separated values: numbers and fields as text (RFC 4180).

use std::borrow::Cow;

/// The text with the fewest digits that reads back to the same number; `nan`, `inf` and `-inf` where
/// there is none. Powers of ten are written where plain decimals would need rows of zeros.
pub fn csv_number(x: f64) -> String {
    if x.is_nan() {
        return "nan".into();
    }
    let size = x.abs();
    // The bounds within which most programs print plain decimals.
    if x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&size) {
        format!("{x}")
    } else {
        format!("{x:e}")
    }
}

/// A field as it stands in a line: quoted if it holds a comma, a quote or a line break.
pub fn csv_field(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", text.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(text)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn short_numbers() {
        for (x, text) in [
            (0.1, "0.1"),
            (-0.0, "-0"),
            (3.0, "3"),
            (1e-5, "0.00001"),
            (1.5e-7, "1.5e-7"),
            (1e300, "1e300"),
            (f64::INFINITY, "inf"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "nan"),
            (0.1 + 0.2, "0.30000000000000004"),
        ] {
            assert_eq!(csv_number(x), text);
        }
    }

    proptest! {
        #[test]
        fn numbers_read_back(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            let back: f64 = csv_number(x).parse().unwrap();
            prop_assert!(back.to_bits() == x.to_bits() || x.is_nan() && back.is_nan());
        }
    }

    #[test]
    fn fields_are_quoted_where_they_must_be() {
        assert_eq!(csv_field("plain text"), "plain text");
        assert_eq!(csv_field("a,b"), "\"a,b\"");
        assert_eq!(csv_field("6\" lens"), "\"6\"\" lens\"");
        assert_eq!(csv_field("two\nlines"), "\"two\nlines\"");
    }
}
