//! Numbers and lists of numbers in attribute values.

use std::ops::Range;

use super::message::{Checked, Complaint, quoted};
use super::text::Text;

/// A finite number.
///
/// # Errors
/// Anything else, with its place.
pub(super) fn float(text: &Text) -> Checked<f64> {
    let range = trimmed(&text.value, 0..text.value.len());
    float_in(text, range)
}

/// A whole number.
///
/// # Errors
/// Anything else, with its place.
pub(super) fn integer(text: &Text) -> Checked<i64> {
    let range = trimmed(&text.value, 0..text.value.len());
    let digits = &text.value[range.clone()];
    digits.parse().map_err(|_| {
        Complaint::at(text.span, format!("{} is not a whole number", quoted(digits)))
            .help("write digits only: value=\"64\"")
    })
}

/// `true` or `false`.
///
/// # Errors
/// Anything else.
pub(super) fn boolean(text: &Text) -> Checked<bool> {
    match text.value.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        other => {
            Err(Complaint::at(text.span, format!("{} is neither true nor false", quoted(other)))
                .help("write value=\"true\" or value=\"false\""))
        }
    }
}

/// Numbers separated by commas or blanks, at most `limit` of them.
///
/// # Errors
/// A part that is no finite number, with its place; more than `limit`.
pub(super) fn list(text: &Text, limit: usize) -> Checked<Vec<f64>> {
    let mut numbers = Vec::new();
    for range in words(&text.value) {
        if numbers.len() == limit {
            return Err(Complaint::at(text.span, format!("more than {limit} numbers")));
        }
        numbers.push(float_in(text, range)?);
    }
    Ok(numbers)
}

/// One number for all three, or three.
///
/// # Errors
/// Another number of numbers, or no numbers.
pub(super) fn triple(text: &Text) -> Checked<[f64; 3]> {
    match list(text, 16)?.as_slice() {
        [all] => Ok([*all; 3]),
        [a, b, c] => Ok([*a, *b, *c]),
        numbers => {
            Err(Complaint::at(text.span, format!("{} numbers where 3 are needed", numbers.len()))
                .help("write \"1, 2, 3\", or one number for all three"))
        }
    }
}

/// The places of the words between commas and blanks.
pub(super) fn words(text: &str) -> impl Iterator<Item = Range<usize>> + '_ {
    let start = text.as_ptr() as usize;
    text.split([',', ' ', '\t', '\r', '\n']).filter(|w| !w.is_empty()).map(move |w| {
        let at = w.as_ptr() as usize - start;
        at..at + w.len()
    })
}

/// A finite number in a part of a value.
///
/// # Errors
/// Anything else, with its place.
pub(super) fn float_in(text: &Text, range: Range<usize>) -> Checked<f64> {
    let digits = &text.value[range.clone()];
    let place = || if digits.is_empty() { text.span } else { text.locate(range.clone()) };
    let value = digits.parse::<f64>().map_err(|_| {
        Complaint::at(place(), format!("{} is not a number", quoted(digits)))
            .help("write digits with a decimal point, without a unit: 0.5, -2, 1e3")
    })?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Complaint::at(place(), format!("{} is not a finite number", quoted(digits)))
            .help("write digits with a decimal point, without a unit: 0.5, -2, 1e3"))
    }
}

/// A range without the white space at its ends.
pub(super) fn trimmed(text: &str, range: Range<usize>) -> Range<usize> {
    let part = &text[range.clone()];
    let start = range.start + (part.len() - part.trim_start().len());
    start..start + part.trim().len()
}
