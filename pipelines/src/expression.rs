//! Formulas over named numbers: conditions over monitors, boundary values over x, y, z and t.
//!
//! | | |
//! |---|---|
//! | numbers | `2`, `0.5`, `1e-3`, `pi` |
//! | names | `x`, `quality.min`; in braces where a name has other characters: `{wall shear.max}` |
//! | arithmetic | `+ - * / ^`; `^` binds tightest and to the right, so that `-x^2` is `-(x^2)` and `2^3^2` is `2^9` |
//! | comparison | `< <= > >= == !=` |
//! | logic | `&& \|\| !` |
//! | functions | `sqrt exp ln log10 sin cos tan asin acos atan sinh cosh tanh abs sign floor ceil`, `atan2(y, x)`, `pow(x, y)`, `min(...)` and `max(...)` of two or more, `if(condition, then, otherwise)` |
//!
//! A formula is a number or a condition, and that is checked when it is parsed: `1 < x < 2` and `x + (y < 1)` are errors. Parsing
//! makes a short program for a stack of fixed size, so that evaluating one allocates nothing.

use crate::language::nearest;
use crate::limits::{FORMULA, FORMULA_DEPTH};

/// How many intermediate results a formula may need at once.
const STACK: usize = 32;

/// A parsed formula.
///
/// # Example
/// ```
/// use tombolo_pipelines::expression::Expression;
///
/// let inflow = Expression::parse("4 * y * (1 - y) * min(t, 1)", &["x", "y", "z", "t"])?;
/// assert_eq!(inflow.evaluate(&[0.0, 0.5, 0.0, 2.0]), 1.0);
///
/// let alert = Expression::parse_condition("quality.min < 0.05 || velocity.max > 100", &["quality.min", "velocity.max"])?;
/// assert!(alert.holds(&[0.01, 3.0]));
/// # Ok::<(), tombolo_pipelines::expression::ExpressionError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Expression {
    program: Vec<Operation>,
}

/// Why a formula was refused, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("column {column} of the formula: {message}{}", suggestion.as_deref().map_or_else(String::new, |name| format!("; did you mean `{name}`?")))]
pub struct ExpressionError {
    /// The column of the first character of the token at fault, from 1.
    pub column: usize,
    /// What was found, and what was expected.
    pub message: String,
    /// The known name that is nearest to a misspelt one.
    pub suggestion: Option<String>,
}

#[derive(Debug, Clone, Copy)]
enum Operation {
    Constant(f64),
    Value(usize),
    Negate,
    Not,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
    And,
    Or,
    Minimum,
    Maximum,
    Atan2,
    Choose,
    Unary(Function),
}

type Function = fn(f64) -> f64;
const UNARY: [(&str, Function); 17] = [
    ("sqrt", f64::sqrt),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("abs", f64::abs),
    ("sign", |x| if x == 0.0 { 0.0 } else { x.signum() }),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
];
const OTHER_FUNCTIONS: [&str; 5] = ["atan2", "pow", "min", "max", "if"];

impl Expression {
    /// Parses a formula whose value is a number.
    ///
    /// # Arguments
    /// `names` are the names that it may use; their places are those of the values in [`evaluate`](Self::evaluate).
    ///
    /// # Errors
    /// [`ExpressionError`] at the first token that is wrong, with the nearest known name for a misspelt one.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Self::parse_kind(text, names, Kind::Number)
    }

    /// Parses a formula that holds or does not.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_condition(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Self::parse_kind(text, names, Kind::Condition)
    }

    fn parse_kind(text: &str, names: &[&str], expected: Kind) -> Result<Self, ExpressionError> {
        let mut parser = Parser { text, at: 0, names, program: Vec::new(), depth: 0, stack: 0 };
        FORMULA.check(text.len()).map_err(|exceeded| parser.error(0, exceeded.to_string()))?;
        parser.skip_space();
        let start = parser.at;
        let kind = parser.expression(0)?;
        if parser.at < text.len() {
            return Err(parser.error(
                parser.at,
                format!("found {}, expected an operator or the end", parser.found()),
            ));
        }
        parser.require(kind, expected, start)?;
        Ok(Self { program: parser.program })
    }

    /// The value for these values of the names: `NaN` where one is missing. Of a condition, 1 where it holds and 0 elsewhere.
    #[must_use]
    #[inline]
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        let mut stack = [0.0_f64; STACK];
        let mut top = 0;
        // The parser has counted the stack: it never grows beyond its size, nor does an operation find it too short.
        macro_rules! binary {
            (|$left:ident, $right:ident| $result:expr) => {{
                top -= 1;
                let ($left, $right) = (stack[top - 1], stack[top]);
                stack[top - 1] = $result;
            }};
        }
        for operation in &self.program {
            match *operation {
                Operation::Constant(value) => {
                    stack[top] = value;
                    top += 1;
                }
                Operation::Value(index) => {
                    stack[top] = values.get(index).copied().unwrap_or(f64::NAN);
                    top += 1;
                }
                Operation::Negate => stack[top - 1] = -stack[top - 1],
                Operation::Not => stack[top - 1] = 1.0 - stack[top - 1],
                Operation::Unary(function) => stack[top - 1] = function(stack[top - 1]),
                Operation::Add => binary!(|a, b| a + b),
                Operation::Subtract => binary!(|a, b| a - b),
                Operation::Multiply => binary!(|a, b| a * b),
                Operation::Divide => binary!(|a, b| a / b),
                Operation::Power => binary!(|a, b| power(a, b)),
                Operation::Less => binary!(|a, b| f64::from(u8::from(a < b))),
                Operation::LessEqual => binary!(|a, b| f64::from(u8::from(a <= b))),
                Operation::Greater => binary!(|a, b| f64::from(u8::from(a > b))),
                Operation::GreaterEqual => binary!(|a, b| f64::from(u8::from(a >= b))),
                Operation::Equal => binary!(|a, b| f64::from(u8::from(a == b))),
                Operation::NotEqual => binary!(|a, b| f64::from(u8::from(a != b))),
                Operation::And => binary!(|a, b| f64::from(u8::from(a != 0.0 && b != 0.0))),
                Operation::Or => binary!(|a, b| f64::from(u8::from(a != 0.0 || b != 0.0))),
                Operation::Minimum => binary!(|a, b| if a.is_nan() || a < b { a } else { b }),
                Operation::Maximum => binary!(|a, b| if a.is_nan() || a > b { a } else { b }),
                Operation::Atan2 => binary!(|a, b| a.atan2(b)),
                Operation::Choose => {
                    top -= 2;
                    stack[top - 1] =
                        if stack[top - 1] != 0.0 { stack[top] } else { stack[top + 1] };
                }
            }
        }
        stack[0]
    }

    /// Whether a condition holds for these values of the names. A comparison with `NaN` does not hold.
    #[must_use]
    pub fn holds(&self, values: &[f64]) -> bool {
        self.evaluate(values) != 0.0
    }
}

/// Small whole powers are products, which are faster and give the same bits on every machine.
fn power(base: f64, exponent: f64) -> f64 {
    if exponent == 2.0 {
        base * base
    } else if exponent == 3.0 {
        base * base * base
    } else {
        base.powf(exponent)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Number,
    Condition,
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    names: &'a [&'a str],
    program: Vec<Operation>,
    depth: usize,
    stack: usize,
}

/// The binary operators: text, how tightly they bind, what they take and give. Longer ones come before their beginnings.
const BINARY: [(&str, u8, Kind, Kind); 13] = [
    ("||", 1, Kind::Condition, Kind::Condition),
    ("&&", 2, Kind::Condition, Kind::Condition),
    ("==", 3, Kind::Number, Kind::Condition),
    ("!=", 3, Kind::Number, Kind::Condition),
    ("<=", 3, Kind::Number, Kind::Condition),
    (">=", 3, Kind::Number, Kind::Condition),
    ("<", 3, Kind::Number, Kind::Condition),
    (">", 3, Kind::Number, Kind::Condition),
    ("+", 4, Kind::Number, Kind::Number),
    ("-", 4, Kind::Number, Kind::Number),
    ("*", 5, Kind::Number, Kind::Number),
    ("/", 5, Kind::Number, Kind::Number),
    ("^", 7, Kind::Number, Kind::Number),
];
/// A sign binds tighter than a product and looser than a power.
const SIGN: u8 = 6;

impl Parser<'_> {
    fn rest(&self) -> &str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn found(&self) -> String {
        match self.rest().chars().next() {
            None => "the end of the formula".into(),
            Some('=') => "'=' (equality is '==')".into(),
            Some('&') => "'&' (and is '&&')".into(),
            Some('|') => "'|' (or is '||')".into(),
            Some(other) => format!("{other:?}"),
        }
    }

    fn error(&self, at: usize, message: String) -> ExpressionError {
        let column = self.text.get(..at).map_or(0, |before| before.chars().count()) + 1;
        ExpressionError { column, message, suggestion: None }
    }

    fn require(&self, found: Kind, expected: Kind, at: usize) -> Result<(), ExpressionError> {
        if found == expected {
            return Ok(());
        }
        let message = match expected {
            Kind::Number => "found a condition, expected a number",
            Kind::Condition => "found a number, expected a condition such as `a < b`",
        };
        Err(self.error(at, message.into()))
    }

    /// Appends an operation that takes and gives so many values.
    fn push(
        &mut self,
        operation: Operation,
        takes: usize,
        at: usize,
    ) -> Result<(), ExpressionError> {
        self.stack = self.stack + 1 - takes;
        if self.stack > STACK {
            return Err(self.error(
                at,
                format!("the formula needs more than {STACK} intermediate results at once"),
            ));
        }
        self.program.push(operation);
        Ok(())
    }

    fn expect(&mut self, token: char, what: &str) -> Result<(), ExpressionError> {
        self.skip_space();
        if self.rest().starts_with(token) {
            self.at += token.len_utf8();
            self.skip_space();
            return Ok(());
        }
        Err(self.error(self.at, format!("found {}, expected {what}", self.found())))
    }

    /// An operand and all operators after it that bind at least this tightly.
    fn expression(&mut self, tightness: u8) -> Result<Kind, ExpressionError> {
        self.depth += 1;
        FORMULA_DEPTH
            .check(self.depth)
            .map_err(|exceeded| self.error(self.at, exceeded.to_string()))?;
        self.skip_space();
        let start = self.at;
        let mut kind = self.operand()?;
        loop {
            self.skip_space();
            let operator = self.at;
            let Some(&(token, binds, takes, gives)) =
                BINARY.iter().find(|entry| self.rest().starts_with(entry.0))
            else {
                break;
            };
            if binds < tightness {
                break;
            }
            self.require(kind, takes, start)?;
            self.at += token.len();
            self.skip_space();
            let right = self.at;
            // A comparison beside a comparison then meets a condition where it takes a number, and says so.
            let other = self.expression(if token == "^" { SIGN } else { binds + 1 })?;
            self.require(other, takes, right)?;
            kind = gives;
            let operation = match token {
                "||" => Operation::Or,
                "&&" => Operation::And,
                "==" => Operation::Equal,
                "!=" => Operation::NotEqual,
                "<=" => Operation::LessEqual,
                "<" => Operation::Less,
                ">=" => Operation::GreaterEqual,
                ">" => Operation::Greater,
                "+" => Operation::Add,
                "-" => Operation::Subtract,
                "*" => Operation::Multiply,
                "/" => Operation::Divide,
                _ => Operation::Power,
            };
            self.push(operation, 2, operator)?;
        }
        self.depth -= 1;
        Ok(kind)
    }

    fn operand(&mut self) -> Result<Kind, ExpressionError> {
        let start = self.at;
        match self.rest().chars().next() {
            Some(sign @ ('-' | '+')) => {
                self.at += 1;
                self.skip_space();
                let (at, kind) = (self.at, self.expression(SIGN)?);
                self.require(kind, Kind::Number, at)?;
                if sign == '-' {
                    self.push(Operation::Negate, 1, start)?;
                }
                Ok(Kind::Number)
            }
            Some('!') => {
                self.at += 1;
                self.skip_space();
                let (at, kind) = (self.at, self.expression(SIGN)?);
                self.require(kind, Kind::Condition, at)?;
                self.push(Operation::Not, 1, start)?;
                Ok(Kind::Condition)
            }
            Some('(') => {
                self.at += 1;
                let kind = self.expression(0)?;
                self.expect(')', "an operator or ')'")?;
                Ok(kind)
            }
            Some('{') => {
                let Some(length) = self.rest().find('}') else {
                    return Err(self.error(start, "found '{' without its '}'".into()));
                };
                let name = self.rest()[1..length].to_owned();
                self.at += length + 1;
                self.value(&name, start)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            _ => Err(self
                .error(start, format!("found {}, expected a number, a name or '('", self.found()))),
        }
    }

    fn number(&mut self) -> Result<Kind, ExpressionError> {
        let (start, bytes) = (self.at, self.text.as_bytes());
        let digits = |mut at: usize| {
            while bytes.get(at).is_some_and(u8::is_ascii_digit) {
                at += 1;
            }
            at
        };
        let mut end = digits(start);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let exponent = digits(end + 1 + sign);
            if exponent > end + 1 + sign {
                end = exponent;
            }
        }
        let token = &self.text[start..end];
        match token.parse::<f64>() {
            Ok(value) if value.is_finite() => {
                self.at = end;
                self.push(Operation::Constant(value), 0, start)?;
                Ok(Kind::Number)
            }
            Ok(_) => {
                Err(self
                    .error(start, format!("{token:.40} is beyond the range of double precision")))
            }
            Err(_) => Err(self.error(start, format!("found {token:?}, expected a number"))),
        }
    }

    fn name(&mut self) -> Result<Kind, ExpressionError> {
        let start = self.at;
        let end = self
            .rest()
            .find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'))
            .map_or(self.text.len(), |length| start + length);
        let name = self.text[start..end].to_owned();
        self.at = end;
        self.skip_space();
        if self.rest().starts_with('(') {
            self.at += 1;
            return self.call(&name, start);
        }
        self.value(&name, start)
    }

    fn value(&mut self, name: &str, start: usize) -> Result<Kind, ExpressionError> {
        if let Some(index) = self.names.iter().position(|known| *known == name) {
            self.push(Operation::Value(index), 0, start)?;
        } else if name == "pi" {
            self.push(Operation::Constant(std::f64::consts::PI), 0, start)?;
        } else {
            let known =
                if self.names.is_empty() { "no names".to_owned() } else { self.names.join(", ") };
            let mut error = self.error(
                start,
                format!("found the unknown name `{name:.60}`, expected one of: {known}"),
            );
            error.suggestion = nearest(name, self.names.iter().copied()).map(str::to_owned);
            return Err(error);
        }
        Ok(Kind::Number)
    }

    fn call(&mut self, name: &str, start: usize) -> Result<Kind, ExpressionError> {
        if let Some(&(_, function)) = UNARY.iter().find(|entry| entry.0 == name) {
            self.argument(Kind::Number)?;
            self.expect(')', "')'")?;
            self.push(Operation::Unary(function), 1, start)?;
            return Ok(Kind::Number);
        }
        let operation = match name {
            "atan2" => Operation::Atan2,
            "pow" => Operation::Power,
            "min" => Operation::Minimum,
            "max" => Operation::Maximum,
            "if" => {
                self.argument(Kind::Condition)?;
                for _ in 0..2 {
                    self.expect(',', "','")?;
                    self.argument(Kind::Number)?;
                }
                self.expect(')', "')'")?;
                self.push(Operation::Choose, 3, start)?;
                return Ok(Kind::Number);
            }
            _ => {
                let known = UNARY.iter().map(|entry| entry.0).chain(OTHER_FUNCTIONS);
                let mut error =
                    self.error(start, format!("found the unknown function `{name:.60}`"));
                error.suggestion = nearest(name, known).map(str::to_owned);
                return Err(error);
            }
        };
        self.argument(Kind::Number)?;
        self.expect(',', "','")?;
        self.argument(Kind::Number)?;
        self.push(operation, 2, start)?;
        let any_number = name == "min" || name == "max";
        while any_number && self.rest().starts_with(',') {
            self.expect(',', "','")?;
            self.argument(Kind::Number)?;
            self.push(operation, 2, start)?;
        }
        self.expect(')', "')'")?;
        Ok(Kind::Number)
    }

    fn argument(&mut self, expected: Kind) -> Result<(), ExpressionError> {
        self.skip_space();
        let start = self.at;
        let kind = self.expression(0)?;
        self.require(kind, expected, start)?;
        self.skip_space();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> f64 {
        Expression::parse(text, &["x", "y"])
            .unwrap_or_else(|error| panic!("{text}: {error}"))
            .evaluate(&[3.0, 5.0])
    }

    #[test]
    fn arithmetic_is_that_of_mathematics() {
        assert_eq!(number("1 + 2 * 3 - 4 / 8"), 6.5);
        assert_eq!(number("-x^2"), -9.0);
        assert_eq!(number("2^3^2"), 512.0);
        assert_eq!(number("2^-1"), 0.5);
        assert_eq!(number("10 - 3 - 2"), 5.0);
        assert_eq!(number("16 / 4 / 2"), 2.0);
        assert_eq!(number("1e-3 * 1E+3 + .5 + 2."), 3.5);
        assert_eq!(number("max(1, x, min(y, 4)) + if(x < y && !(y < x), 10, 20)"), 14.0);
        assert_eq!(number("--x - -y"), 8.0);
        assert!(
            (number("sin(pi / 2) + sqrt(pow(x, 2)) + abs(-y) + atan2(0, 1)") - 9.0).abs() < 1e-15
        );
    }

    #[test]
    fn conditions_bind_as_in_c() {
        let names = ["quality.min", "wall shear.max", "n"];
        let holds = |text: &str| {
            Expression::parse_condition(text, &names).unwrap().holds(&[0.5, 7.0, f64::NAN])
        };
        assert!(holds("quality.min < 0.05 || {wall shear.max} > 6 && quality.min == 0.5"));
        assert!(!holds("(quality.min < 0.05 || {wall shear.max} > 6) && quality.min != 0.5"));
        assert!(!holds("n < 1 || n >= 1 || n == n"), "nothing holds of NaN");
        assert!(holds("quality.min + 1 <= 1.5"));
    }

    #[test]
    fn errors_have_a_place_and_a_near_name() {
        let fails = |text: &str| {
            Expression::parse_condition(text, &["quality.min", "velocity.max"]).unwrap_err()
        };
        let error = fails("quality.min < 0.05 || velocty.max > 1");
        assert_eq!((error.column, error.suggestion.as_deref()), (23, Some("velocity.max")));
        for (text, column, message) in [
            ("", 1, "the end"),
            ("quality.min", 1, "expected a condition"),
            ("quality.min < ", 15, "the end"),
            ("0 < quality.min < 1", 1, "expected a number"),
            ("quality.min = 1", 13, "equality is '=='"),
            ("quality.min < 1 & 1 < 2", 17, "and is '&&'"),
            ("(quality.min < 1", 17, "')'"),
            ("quality.min < 1e999", 15, "beyond the range"),
            ("quality.min < sqrt(1, 2)", 21, "')'"),
            ("quality.min < 1 + (2 < 3)", 19, "expected a number"),
            ("é < 1", 1, "unknown name"),
            ("{quality.min < 1", 1, "without its '}'"),
        ] {
            let error = fails(text);
            assert!(error.message.contains(message), "{text}: {error}");
            assert_eq!(error.column, column, "{text}: {error}");
        }
        assert_eq!(fails("sqr(1) < 2").suggestion.as_deref(), Some("sqrt"));
        assert!(fails(&"(".repeat(100_000)).message.contains("characters"));
        assert!(fails(&"(".repeat(300)).message.contains("at most"), "{}", fails(&"(".repeat(300)));
        assert!(fails(&"1+(".repeat(60)).message.contains("intermediate results"));
    }
}
