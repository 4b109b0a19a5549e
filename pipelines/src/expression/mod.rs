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
//! A formula is a number or a condition, and that is checked when it is parsed: neither
//! `1 < x < 2` nor `x + (y < 1)` is a formula. Parsing makes a short program for a stack of fixed
//! size, so that evaluating one allocates nothing.

mod parser;
mod program;

use parser::{Kind, parse, parse_open};
use program::{Operation, evaluate};

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

/// A name that a formula uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsedName {
    /// The name.
    pub name: String,
    /// The column of its first character where it stands first, from 1.
    pub column: usize,
}

/// Why a formula was refused, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("column {column} of the formula: {message}{}", suggestion.as_deref().map_or_else(String::new, |name| format!("; did you mean `{name}`?")))]
pub struct ExpressionError {
    /// The column of the first character of the token at fault, from 1.
    pub column: usize,
    /// The thing found, and the thing expected.
    pub message: String,
    /// The known name that is nearest to a misspelt one.
    pub suggestion: Option<String>,
}

impl Expression {
    /// Parses a formula whose value is a number.
    ///
    /// # Arguments
    /// `names` are the names that it may use; their positions are those of the values in
    /// [`evaluate`](Self::evaluate).
    ///
    /// # Errors
    /// [`ExpressionError`] at the first token that is wrong, with the nearest known name for a
    /// misspelt one.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Ok(Self { program: parse(text, names, Kind::Number)? })
    }

    /// Parses a condition.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_condition(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Ok(Self { program: parse(text, names, Kind::Condition)? })
    }

    /// Parses a formula whose value is a number and that may use any name, and returns the names
    /// that it uses: their positions are those of the values in [`evaluate`](Self::evaluate).
    ///
    /// ```
    /// use tombolo_pipelines::expression::Expression;
    ///
    /// let (energy, names) = Expression::parse_open("density * speed^2 / 2")?;
    /// assert_eq!(names, ["density", "speed"]);
    /// assert_eq!(energy.evaluate(&[2.0, 3.0]), 9.0);
    /// # Ok::<(), tombolo_pipelines::expression::ExpressionError>(())
    /// ```
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_open(text: &str) -> Result<(Self, Vec<String>), ExpressionError> {
        let (program, names) = parse_open(text, Kind::Number)?;
        Ok((Self { program }, names.into_iter().map(|used| used.name).collect()))
    }

    /// Parses a condition that may use any name, and returns the names that it uses.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_open_condition(text: &str) -> Result<(Self, Vec<UsedName>), ExpressionError> {
        let (program, names) = parse_open(text, Kind::Condition)?;
        Ok((Self { program }, names))
    }

    /// The value for these values of the names: `NaN` where one is missing. Of a condition, 1 where
    /// it holds and 0 elsewhere.
    #[must_use]
    #[inline]
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        evaluate(&self.program, values)
    }

    /// Whether a condition holds for these values of the names. A comparison with `NaN` does not
    /// hold.
    #[must_use]
    pub fn holds(&self, values: &[f64]) -> bool {
        self.evaluate(values) != 0.0
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
    fn no_comparison_with_nan_holds() {
        for operator in ["==", "!=", "<", "<=", ">", ">="] {
            let text = format!("x {operator} 0");
            let condition = Expression::parse_condition(&text, &["x"]).unwrap();
            assert!(!condition.holds(&[f64::NAN]), "{text}");
        }
        let differs = Expression::parse_condition("x != 3", &["x"]).unwrap();
        assert_eq!([2.0, 3.0, 4.0].map(|x| differs.holds(&[x])), [true, false, true]);
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
    fn errors_have_a_column_and_a_near_name() {
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
