//! From the text of a formula to its operations.

use tombolo_deform::names::nearest;

use super::program::{Operation, STACK, UNARY};
use super::{ExpressionError, UsedName};
use crate::limits::{FORMULA, FORMULA_DEPTH};

/// The functions of more than one number.
const OTHER_FUNCTIONS: [&str; 5] = ["atan2", "pow", "min", "max", "if"];

/// The kind of value that a formula has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Number,
    Condition,
}

/// The column of a byte of a text, from 1.
fn column(text: &str, at: usize) -> usize {
    text.get(..at).map_or(0, |before| before.chars().count()) + 1
}

/// The operations of a formula whose value is of this kind.
pub(super) fn parse(
    text: &str,
    names: &[&str],
    expected: Kind,
) -> Result<Vec<Operation>, ExpressionError> {
    parsed(Parser::new(text, names), expected).map(|parser| parser.program)
}

/// The operations of a formula that may use any name, and the names that it uses: their positions
/// are those of the values.
pub(super) fn parse_open(
    text: &str,
    expected: Kind,
) -> Result<(Vec<Operation>, Vec<UsedName>), ExpressionError> {
    let parser = Parser { found_names: Some(Vec::new()), ..Parser::new(text, &[]) };
    let parser = parsed(parser, expected)?;
    Ok((parser.program, parser.found_names.unwrap_or_default()))
}

fn parsed(mut parser: Parser<'_>, expected: Kind) -> Result<Parser<'_>, ExpressionError> {
    let text = parser.text;
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
    Ok(parser)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    names: &'a [&'a str],
    /// The names found so far, where any may be used.
    found_names: Option<Vec<UsedName>>,
    program: Vec<Operation>,
    depth: usize,
    stack: usize,
}

/// The binary operators: text, how tightly they bind, what they take and give, and what is done.
/// Longer ones come before their beginnings.
const BINARY: [(&str, u8, Kind, Kind, Operation); 13] = [
    ("||", 1, Kind::Condition, Kind::Condition, Operation::Or),
    ("&&", 2, Kind::Condition, Kind::Condition, Operation::And),
    ("==", 3, Kind::Number, Kind::Condition, Operation::Equal),
    ("!=", 3, Kind::Number, Kind::Condition, Operation::NotEqual),
    ("<=", 3, Kind::Number, Kind::Condition, Operation::LessEqual),
    (">=", 3, Kind::Number, Kind::Condition, Operation::GreaterEqual),
    ("<", 3, Kind::Number, Kind::Condition, Operation::Less),
    (">", 3, Kind::Number, Kind::Condition, Operation::Greater),
    ("+", 4, Kind::Number, Kind::Number, Operation::Add),
    ("-", 4, Kind::Number, Kind::Number, Operation::Subtract),
    ("*", 5, Kind::Number, Kind::Number, Operation::Multiply),
    ("/", 5, Kind::Number, Kind::Number, Operation::Divide),
    ("^", 7, Kind::Number, Kind::Number, Operation::Power),
];
/// A sign binds tighter than a product and looser than a power.
const SIGN: u8 = 6;

impl<'a> Parser<'a> {
    fn new(text: &'a str, names: &'a [&'a str]) -> Self {
        Self { text, at: 0, names, found_names: None, program: Vec::new(), depth: 0, stack: 0 }
    }

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
        ExpressionError { column: column(self.text, at), message, suggestion: None }
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
            let Some(&(token, binds, takes, gives, operation)) =
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
            // A comparison beside a comparison then meets a condition where it takes a number, and
            // says so.
            let other = self.expression(if token == "^" { SIGN } else { binds + 1 })?;
            self.require(other, takes, right)?;
            kind = gives;
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
        } else if let Some(found) = &mut self.found_names {
            let index = found.iter().position(|known| known.name == name).unwrap_or_else(|| {
                found.push(UsedName { name: name.to_owned(), column: column(self.text, start) });
                found.len() - 1
            });
            self.push(Operation::Value(index), 0, start)?;
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
