//! The parameters that a solver declares, one after the other, before its run begins.

use crate::steering::Parameters;
use crate::{Parameter, ParameterError};

/// Declares a parameter beside those that are declared already. One that makes no sense beside them
/// is not kept, so that a solver can go on and declare it rightly.
///
/// # Errors
/// [`ParameterError`] where its bounds or its value make no sense, or its name is declared already.
pub fn declare(
    parameters: &mut Vec<Parameter>,
    parameter: Parameter,
) -> Result<(), ParameterError> {
    let mut all = parameters.clone();
    all.push(parameter);
    Parameters::new(all.clone())?;
    *parameters = all;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_parameter_is_not_kept() {
        let mut parameters = Vec::new();
        let mut declared = |value: f64, maximum: f64| {
            let parameter = Parameter { name: "inflow".into(), value, minimum: 0.0, maximum };
            let declared = declare(&mut parameters, parameter);
            (declared.map_err(|error| error.to_string()), parameters.len())
        };
        for (value, maximum) in [(50.0, 40.0), (f64::NAN, 40.0), (1.0, f64::INFINITY), (-1.0, -2.0)]
        {
            let (refused, kept) = declared(value, maximum);
            assert!(refused.is_err_and(|told| told.contains("'inflow'")), "{value}, {maximum}");
            assert_eq!(kept, 0);
        }
        assert_eq!(declared(5.0, 40.0), (Ok(()), 1));
        let twice = Err("parameter 'inflow' is declared twice".to_owned());
        assert_eq!(declared(5.0, 40.0), (twice, 1));
    }
}
