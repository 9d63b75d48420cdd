//! From text to a graph: a Pratt parser that keeps positions.

use std::ops::Range;

use super::graph::{Binary, Graph, NodeId, Unary};
use super::names::nearest_name;

/// All functions that formulas know.
pub const FUNCTIONS: [&str; 14] = [
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt", "exp", "log", "abs", "min",
    "max", "hypot",
];

/// Longest text [bytes]. A formula is written by hand; this is some hundred times the longest seen.
const MAX_TEXT: usize = 65_536;

/// Deepest nesting of parentheses, powers and signs: far beyond what one reads, far below what a
/// thread's stack holds.
const MAX_DEPTH: u32 = 200;

/// What is wrong with a formula.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct FormulaError {
    /// The offending bytes of the text.
    pub span: Range<usize>,
    /// A sentence that says what is wrong and what would be right.
    pub message: String,
}

/// A parsed formula.
#[derive(Clone, Debug)]
pub struct Formula {
    pub(super) graph: Graph,
    pub(super) root: NodeId,
    pub(super) variables: usize,
}

impl Formula {
    /// Parses `text`, in which `variables` and `constants` may be named. A variable is known to
    /// [`super::Tape`] by its place in `variables`.
    ///
    /// # Errors
    /// With the span in `text`: what is not a formula, an unknown name (the nearest known one is
    /// told), a wrong number of arguments, a text above 64 KiB, nesting deeper than 200. With an
    /// empty span at 0: a constant that [`check_constant_name`] refuses or that is not finite.
    pub fn parse(
        text: &str,
        variables: &[&str],
        constants: &[(String, f64)],
    ) -> Result<Self, FormulaError> {
        if text.len() > MAX_TEXT {
            return Err(FormulaError {
                span: 0..text.len(),
                message: format!(
                    "This formula has {} bytes; at most {MAX_TEXT} are read. Shorten it.",
                    text.len()
                ),
            });
        }
        for (name, value) in constants {
            let complaint = match check_constant_name(name, variables) {
                Err(message) => message,
                Ok(()) if !value.is_finite() => {
                    format!("The constant \"{name}\" is {value}; give it a finite value.")
                }
                Ok(()) => continue,
            };
            return Err(FormulaError { span: 0..0, message: complaint });
        }
        let mut parser = Parser {
            text,
            position: 0,
            token: Token::End,
            span: 0..0,
            end_of_last: 0,
            depth: 0,
            variables,
            constants,
            graph: Graph::default(),
        };
        parser.advance()?;
        if parser.token == Token::End {
            return Err(parser.error_here("The formula is empty; write a number or a formula."));
        }
        let root = parser.expression(0)?;
        match parser.token {
            Token::End => Ok(Self { graph: parser.graph, root, variables: variables.len() }),
            Token::Close => Err(parser.error_here(
                "This closing parenthesis has no opening one; remove it or open one before it.",
            )),
            Token::Comma => Err(parser
                .error_here("A comma stands only between the arguments of a function; remove it.")),
            _ => Err(parser.error_here(
                "An operator (+ - * / ^) is missing before this; products need a *, as in 2*s.",
            )),
        }
    }
}

/// Whether a constant may have this name.
///
/// # Errors
/// A sentence: it is no name (a letter or _, then letters, digits, _), or it is the name of a variable,
/// of a function or of `pi`.
pub fn check_constant_name(name: &str, variables: &[&str]) -> Result<(), String> {
    let mut bytes = name.bytes();
    let starts_well = bytes.next().is_some_and(|b| b.is_ascii_alphabetic() || b == b'_');
    if !starts_well || !bytes.all(is_name_byte) {
        return Err(format!(
            "\"{name}\" cannot name a constant: a name is a letter or _, then letters, digits and _."
        ));
    }
    let what = if variables.contains(&name) {
        "a variable"
    } else if FUNCTIONS.contains(&name) {
        "a function"
    } else if name == "pi" {
        "the number pi"
    } else {
        return Ok(());
    };
    Err(format!("The constant \"{name}\" has the name of {what}; give it another name."))
}

fn is_name_byte(b: u8) -> bool {
    b.is_ascii_alphanumeric() || b == b'_'
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Token {
    Number(f64),
    Name,
    Plus,
    Minus,
    Star,
    Slash,
    Caret,
    Open,
    Close,
    Comma,
    End,
}

struct Parser<'a> {
    text: &'a str,
    /// Where the next token starts or blanks before it.
    position: usize,
    token: Token,
    span: Range<usize>,
    end_of_last: usize,
    depth: u32,
    variables: &'a [&'a str],
    constants: &'a [(String, f64)],
    graph: Graph,
}

/// Binding powers of the signs + and − before an operand: above products, below powers.
const SIGN: u8 = 5;

impl Parser<'_> {
    fn error(&self, span: Range<usize>, message: impl Into<String>) -> FormulaError {
        FormulaError { span, message: message.into() }
    }

    fn error_here(&self, message: &str) -> FormulaError {
        self.error(self.span.clone(), message)
    }

    /// Reads the next token.
    fn advance(&mut self) -> Result<(), FormulaError> {
        self.end_of_last = self.span.end;
        let bytes = self.text.as_bytes();
        while bytes.get(self.position).is_some_and(u8::is_ascii_whitespace) {
            self.position += 1;
        }
        let start = self.position;
        let Some(&first) = bytes.get(start) else {
            self.token = Token::End;
            self.span = start..start;
            return Ok(());
        };
        let mut end = start + 1;
        self.token = match first {
            b'+' => Token::Plus,
            b'-' => Token::Minus,
            b'*' => Token::Star,
            b'/' => Token::Slash,
            b'^' => Token::Caret,
            b'(' => Token::Open,
            b')' => Token::Close,
            b',' => Token::Comma,
            b'0'..=b'9' | b'.' => {
                end = self.number_end(start);
                Token::Number(self.number(start..end)?)
            }
            _ if first.is_ascii_alphabetic() || first == b'_' => {
                while bytes.get(end).is_some_and(|b| is_name_byte(*b)) {
                    end += 1;
                }
                Token::Name
            }
            _ => {
                let c = self.text[start..].chars().next().unwrap_or(' ');
                let hint = match c {
                    '−' | '–' | '—' => "write the minus of the keyboard, -.",
                    '×' | '·' => "write a product with *.",
                    '÷' | ':' => "write a quotient with /.",
                    '²' | '³' => "write a power with ^, as in s^2.",
                    'π' => "write pi.",
                    '[' | '{' | ']' | '}' => "use round parentheses.",
                    _ => "use numbers, names, + - * / ^, parentheses and commas.",
                };
                let span = start..start + c.len_utf8();
                return Err(
                    self.error(span, format!("The character \"{c}\" is not known here; {hint}"))
                );
            }
        };
        self.position = end;
        self.span = start..end;
        Ok(())
    }

    /// Where a number that starts at `start` ends, with all that sticks to it.
    fn number_end(&self, start: usize) -> usize {
        let bytes = self.text.as_bytes();
        let mut end = start;
        while let Some(&b) = bytes.get(end) {
            let sign_of_exponent = (b == b'+' || b == b'-')
                && end > start
                && matches!(bytes[end - 1], b'e' | b'E')
                && {
                    // "2e-3", but not "s2e - 3" nor "2e-x".
                    bytes.get(end + 1).is_some_and(u8::is_ascii_digit)
                };
            if !(is_name_byte(b) || b == b'.' || sign_of_exponent) {
                break;
            }
            end += 1;
        }
        end
    }

    fn number(&self, span: Range<usize>) -> Result<f64, FormulaError> {
        let text = &self.text[span.clone()];
        match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            Ok(_) => Err(self
                .error(span, format!("The number {text} is too large; the largest is 1.8e308."))),
            Err(_) => {
                let digits = text.bytes().take_while(|b| b.is_ascii_digit() || *b == b'.').count();
                let (number, rest) = text.split_at(digits);
                let sticks_to_name =
                    rest.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
                let message = if sticks_to_name && number.parse::<f64>().is_ok() {
                    format!("\"{text}\" is not a number; products need a *: write {number}*{rest}.")
                } else {
                    format!("\"{text}\" is not a number; write it as 12, 1.5 or 2e-3.")
                };
                Err(self.error(span, message))
            }
        }
    }

    /// Pratt: an operand, then operators that bind at least as tightly as `least`.
    fn expression(&mut self, least: u8) -> Result<NodeId, FormulaError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(
                self.error_here("The formula is nested deeper than 200 levels; simplify it.")
            );
        }
        let mut left = self.operand()?;
        loop {
            // (operator, left power, power asked of the right operand): a larger right power makes
            // an operator associate to the left.
            let (operator, power, right) = match self.token {
                Token::Plus => (Binary::Add, 1, 2),
                Token::Minus => (Binary::Sub, 1, 2),
                Token::Star => (Binary::Mul, 3, 4),
                Token::Slash => (Binary::Div, 3, 4),
                Token::Caret => (Binary::Pow, 7, 6),
                _ => break,
            };
            if power < least {
                break;
            }
            self.advance()?;
            let b = self.expression(right)?;
            left = self.graph.binary(operator, left, b);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn operand(&mut self) -> Result<NodeId, FormulaError> {
        match self.token {
            Token::Number(x) => {
                self.advance()?;
                Ok(self.graph.constant(x))
            }
            Token::Minus => {
                self.advance()?;
                let a = self.expression(SIGN)?;
                Ok(self.graph.unary(Unary::Neg, a))
            }
            Token::Plus => {
                self.advance()?;
                self.expression(SIGN)
            }
            Token::Open => {
                let open = self.span.clone();
                self.advance()?;
                let a = self.expression(0)?;
                self.close(open)?;
                Ok(a)
            }
            Token::Name => self.name(),
            Token::End => Err(self.error(
                self.end_of_last.saturating_sub(1)..self.end_of_last,
                "The formula ends where a number, a name or a parenthesis must follow.",
            )),
            _ => {
                Err(self.error_here("Here a number, a name or an opening parenthesis must stand."))
            }
        }
    }

    /// The closing parenthesis of the one at `open`.
    fn close(&mut self, open: Range<usize>) -> Result<(), FormulaError> {
        match self.token {
            Token::Close => self.advance(),
            Token::End => {
                Err(self.error(open, "This parenthesis is not closed; add a closing one."))
            }
            Token::Comma => Err(self
                .error_here("A comma stands only between the arguments of a function; remove it.")),
            _ => Err(self.error_here(
                "An operator (+ - * / ^) or a closing parenthesis is missing before this; products \
                 need a *, as in 2*s.",
            )),
        }
    }

    fn name(&mut self) -> Result<NodeId, FormulaError> {
        let span = self.span.clone();
        let text = self.text;
        let name = &text[span.clone()];
        self.advance()?;
        if FUNCTIONS.contains(&name) {
            return self.call(name, span);
        }
        let node = if let Some(i) = self.variables.iter().position(|v| *v == name) {
            self.graph.variable(i as u32)
        } else if let Some((_, value)) = self.constants.iter().find(|(n, _)| n == name) {
            self.graph.constant(*value)
        } else if name == "pi" {
            self.graph.constant(std::f64::consts::PI)
        } else {
            return Err(self.unknown_name(name, span));
        };
        if self.token == Token::Open {
            return Err(self.error(
                span,
                format!("\"{name}\" is not a function; products need a *: write {name}*(…)."),
            ));
        }
        Ok(node)
    }

    fn unknown_name(&self, name: &str, span: Range<usize>) -> FormulaError {
        let known = (self.variables.iter().copied())
            .chain(self.constants.iter().map(|(n, _)| n.as_str()))
            .chain(["pi"])
            .chain(FUNCTIONS);
        let mut message = format!("The name \"{name}\" is not known");
        match nearest_name(name, known) {
            Some(near) => message += &format!("; did you mean \"{near}\"?"),
            None => {
                message += &format!(
                    "; known are the variables {}, pi, the constants given beside the formula, and \
                     the functions {}.",
                    self.variables.join(", "),
                    FUNCTIONS.join(" ")
                );
            }
        }
        self.error(span, message)
    }

    /// The arguments of a function.
    fn call(&mut self, name: &str, span: Range<usize>) -> Result<NodeId, FormulaError> {
        if self.token != Token::Open {
            return Err(self.error(
                span,
                format!("The function \"{name}\" needs its argument in parentheses: {name}(…)."),
            ));
        }
        let open = self.span.clone();
        self.advance()?;
        let mut arguments = arrayvec::ArrayVec::<NodeId, 2>::new();
        let mut count = 0usize;
        let folding = match name {
            "min" => Some(Binary::Min),
            "max" => Some(Binary::Max),
            _ => None,
        };
        while self.token != Token::Close || count > 0 {
            let a = self.expression(0)?;
            count += 1;
            match (folding, arguments.first().copied()) {
                (Some(f), Some(b)) => arguments[0] = self.graph.binary(f, b, a),
                _ if count <= 2 => arguments.push(a),
                _ => {}
            }
            if self.token != Token::Comma {
                break;
            }
            self.advance()?;
        }
        let end = self.span.end;
        self.close(open)?;
        let wrong = |wanted: &str| FormulaError {
            span: span.start..end,
            message: format!("The function \"{name}\" takes {wanted}, not {count}."),
        };
        let two = match name {
            "min" | "max" => {
                return match arguments.first() {
                    Some(a) if count >= 2 => Ok(*a),
                    _ => Err(wrong("two or more arguments")),
                };
            }
            "atan2" => Some(Binary::Atan2),
            "hypot" => Some(Binary::Hypot),
            _ => None,
        };
        if let Some(f) = two {
            return match (count, arguments.as_slice()) {
                (2, [a, b]) => Ok(self.graph.binary(f, *a, *b)),
                _ => Err(wrong("two arguments")),
            };
        }
        let f = match name {
            "sin" => Unary::Sin,
            "cos" => Unary::Cos,
            "tan" => Unary::Tan,
            "asin" => Unary::Asin,
            "acos" => Unary::Acos,
            "atan" => Unary::Atan,
            "sqrt" => Unary::Sqrt,
            "exp" => Unary::Exp,
            "log" => Unary::Log,
            _ => Unary::Abs,
        };
        match (count, arguments.as_slice()) {
            (1, [a]) => Ok(self.graph.unary(f, *a)),
            _ => Err(wrong("one argument")),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn error(text: &str) -> (String, String) {
        let e = Formula::parse(text, &["s", "t"], &[("depth".into(), 1.0)]).unwrap_err();
        assert!(!e.message.is_empty());
        (text[e.span].to_string(), e.message)
    }

    #[test]
    fn errors_point_at_their_cause() {
        for (text, span, words) in [
            ("s +* t", "*", "number"),
            ("s + (t*2", "(", "not closed"),
            ("s + t)", ")", "no opening"),
            ("2s", "2s", "2*s"),
            ("2 s", "s", "2*s"),
            ("(1) (2)", "(", "operator"),
            ("sine(s)", "sine", "\"sin\""),
            ("s*dpeth", "dpeth", "\"depth\""),
            ("u + 1", "u", "variables s, t"),
            ("sin s", "sin", "sin(…)"),
            ("sin()", "sin()", "one argument, not 0"),
            ("1+sin(s, t)", "sin(s, t)", "one argument, not 2"),
            ("atan2(s)", "atan2(s)", "two arguments, not 1"),
            ("min(s)", "min(s)", "two or more"),
            ("s(2)", "s", "s*(…)"),
            ("1.2.3", "1.2.3", "2e-3"),
            ("1e999", "1e999", "too large"),
            ("s + ", "+", "ends where"),
            ("s, t", ",", "comma"),
            ("(s, t)", ",", "comma"),
            ("s·t", "·", "*"),
            ("s²", "²", "^"),
            ("s # t", "#", "not known"),
            ("", "", "empty"),
            ("  ", "", "empty"),
        ] {
            let (at, message) = error(text);
            assert_eq!(at, span, "{text}: {message}");
            assert!(message.contains(words), "{text}: {message}");
        }
    }

    #[test]
    fn constants_may_not_hide_anything() {
        for name in ["s", "sin", "pi", "2x", "", "a-b", "é"] {
            let e = Formula::parse("1", &["s", "t"], &[(name.into(), 1.0)]).unwrap_err();
            assert_eq!(e.span, 0..0);
        }
        assert!(Formula::parse("x_1", &["s"], &[("x_1".into(), f64::NAN)]).is_err());
        assert!(Formula::parse("x_1", &["s"], &[("x_1".into(), 1.0)]).is_ok());
    }

    #[test]
    fn nothing_runs_away() {
        let parse = |text: &str| Formula::parse(text, &["s", "t"], &[]);
        for unit in ["(", "-", "2^", "sin(", "s+(", "-(", "min(s,"] {
            let text = format!("{}s", unit.repeat(10_000));
            assert!(parse(&text).unwrap_err().message.contains("200 levels"), "{unit}");
        }
        assert!(parse(&"s+".repeat(40_000)).unwrap_err().message.contains("bytes"));
        assert!(parse(&format!("{}s", "s+".repeat(30_000))).is_ok());
        assert!(parse(&format!("{}s{}", "(".repeat(190), ")".repeat(190))).is_ok());
    }

    proptest::proptest! {
        #![proptest_config(proptest::test_runner::Config { failure_persistence: None, ..Default::default() })]

        #[test]
        fn any_text_is_answered(text in "[-+*/^(),.a-u0-9 πé]{0,40}") {
            if let Err(e) = Formula::parse(&text, &["s", "t"], &[]) {
                proptest::prop_assert!(text.get(e.span).is_some());
            }
        }
    }
}
