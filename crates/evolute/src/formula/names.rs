//! The nearest known name, for messages.

/// The candidate most like `name`, if any is like it: at most a third of its letters (but one of
/// two) are wrong, missing or too many. The first of equals.
pub fn nearest_name<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let limit = match name.chars().count() {
        0 | 1 => 0,
        n => (n / 3).max(1),
    };
    candidates
        .into_iter()
        .map(|c| (distance(name, c), c))
        .filter(|(d, _)| *d <= limit)
        .min_by_key(|(d, _)| *d)
        .map(|(_, c)| c)
}

/// Levenshtein's distance in which two neighbours in the wrong order are one mistake; capital letters
/// count as small ones.
fn distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.to_lowercase().chars().collect();
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut older = vec![0; b.len() + 1];
    let mut old: Vec<usize> = (0..=b.len()).collect();
    let mut row = vec![0; b.len() + 1];
    for i in 0..a.len() {
        row[0] = i + 1;
        for j in 0..b.len() {
            let mut d = old[j] + usize::from(a[i] != b[j]);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                d = d.min(older[j - 1] + 1);
            }
            row[j + 1] = d.min(row[j] + 1).min(old[j + 1] + 1);
        }
        std::mem::swap(&mut older, &mut old);
        std::mem::swap(&mut old, &mut row);
    }
    old[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_was_meant() {
        let known = ["sin", "cos", "sqrt", "amplitude"];
        assert_eq!(nearest_name("sine", known), Some("sin"));
        assert_eq!(nearest_name("Sqr", known), Some("sqrt"));
        assert_eq!(nearest_name("cso", known), Some("cos"));
        assert_eq!(nearest_name("amplitdue", known), Some("amplitude"));
        assert_eq!(nearest_name("banana", known), None);
    }
}
