//! The operations of a formula, for a stack of fixed size, and how they are carried out.

use std::cmp::Ordering;

/// How many intermediate results a formula may need at once.
pub(super) const STACK: usize = 32;

/// An operation of a formula: it takes numbers off the stack and puts one on it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Operation {
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

/// A function of one number.
pub(super) type Function = fn(f64) -> f64;

/// The functions of one number, by name.
pub(super) const UNARY: [(&str, Function); 17] = [
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

/// The value that operations leave on the stack: of a name without a value `NaN`.
///
/// The parser has counted the stack: it never grows beyond its size, nor does an operation find it
/// too short.
#[inline]
pub(super) fn evaluate(program: &[Operation], values: &[f64]) -> f64 {
    let mut stack = [0.0_f64; STACK];
    let mut top = 0;
    macro_rules! binary {
        (|$left:ident, $right:ident| $result:expr) => {{
            top -= 1;
            let ($left, $right) = (stack[top - 1], stack[top]);
            stack[top - 1] = $result;
        }};
    }
    for operation in program {
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
            // Of NaN nothing is known: it differs from nothing either.
            Operation::NotEqual => binary!(|a, b| {
                f64::from(u8::from(a.partial_cmp(&b).is_some_and(Ordering::is_ne)))
            }),
            Operation::And => binary!(|a, b| f64::from(u8::from(a != 0.0 && b != 0.0))),
            Operation::Or => binary!(|a, b| f64::from(u8::from(a != 0.0 || b != 0.0))),
            Operation::Minimum => binary!(|a, b| if a.is_nan() || a < b { a } else { b }),
            Operation::Maximum => binary!(|a, b| if a.is_nan() || a > b { a } else { b }),
            Operation::Atan2 => binary!(|a, b| a.atan2(b)),
            Operation::Choose => {
                top -= 2;
                stack[top - 1] = if stack[top - 1] != 0.0 { stack[top] } else { stack[top + 1] };
            }
        }
    }
    stack[0]
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
