//! What a variable holds of the time of its steps, where that is no mean: told by `cell_methods` (CF 7.3), and refused of what is taken for a
//! mean, a value or a flux by its name. So are differences of temperatures, told by `units_metadata`.

use contract::event::RejectReason;
use contract::quantity::Quantity;

use crate::error::Rejection;
use crate::inspect::file::description::Variable;
use crate::plan::cf::cell_methods;

/// Methods (CF appendix E) whose values are not those of the variable's standard name, with the word for them.
const OTHERS: [(&str, &str); 12] = [
    ("maximum", "highest values"),
    ("maximum_absolute_value", "highest values"),
    ("minimum", "lowest values"),
    ("minimum_absolute_value", "lowest values"),
    ("mid_range", "middles of the range"),
    ("range", "ranges"),
    ("standard_deviation", "standard deviations"),
    ("variance", "variances"),
    ("root_mean_square", "root mean squares"),
    ("sum_of_squares", "sums of squares"),
    ("median", "medians"),
    ("mode", "most frequent values"),
];

/// # Errors
/// A known quantity of which a file holds something else over time: its budget, mean or picture would be taken for that of the quantity. A
/// quantity that is none of the program's own is what its file says.
pub(super) fn check(
    variable: &Variable,
    quantity: Quantity,
    time: Option<&str>,
) -> Result<(), Rejection> {
    if matches!(quantity, Quantity::Open(_)) {
        return Ok(());
    }
    if let Some(said) = of_differences(variable) {
        let detail = format!(
            "holds differences of temperatures (units_metadata {said:?}) and would be taken for {} itself; land it by a profile that gives it a quantity of its own",
            quantity.title()
        );
        return Err(Rejection::new(RejectReason::Values, &variable.name, detail));
    }
    let Some((method, what)) = other_over_time(variable, time) else {
        return Ok(());
    };
    let detail = format!(
        "holds {what} over time (cell_methods {method:?}) and would be taken for {} itself; land it by a profile that gives it a quantity of its own, or give means",
        quantity.title()
    );
    Err(Rejection::new(RejectReason::Values, &variable.name, detail))
}

/// The method along time whose values are not those of the variable's standard name, with the word for them; none if the variable
/// says of no such one. `time` is the name of its time coordinate.
pub(crate) fn other_over_time(
    variable: &Variable,
    time: Option<&str>,
) -> Option<(&'static str, &'static str)> {
    let text = variable.attributes.text("cell_methods")?;
    let said = cell_methods::all_of_time(text, time.unwrap_or("time"));
    OTHERS
        .into_iter()
        .find(|(method, _)| said.iter().any(|words| words[0] == *method))
}

/// What a variable says of its unit where its temperatures are differences of two, which have another zero (CF 1.11, 3.1.2).
fn of_differences(variable: &Variable) -> Option<&str> {
    let said = variable.attributes.text("units_metadata")?;
    let words: Vec<&str> = said.split_whitespace().collect();
    let is_so = |pair: &[&str]| pair == ["temperature:", "difference"];
    words.windows(2).any(is_so).then_some(said)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Kind};

    fn saying(name: &str, text: &str, quantity: Quantity) -> Result<(), Rejection> {
        let text = AttributeValue::Text(text.to_owned());
        let variable = Variable {
            name: "v".to_owned(),
            dimensions: vec![],
            kind: Kind::Float(4),
            attributes: [(name.to_owned(), text)].into_iter().collect(),
        };
        check(&variable, quantity, Some("t"))
    }

    fn said(methods: &str, quantity: Quantity) -> Result<(), Rejection> {
        saying("cell_methods", methods, quantity)
    }

    #[test]
    fn differences_of_temperatures_are_not_taken_for_temperatures() {
        let sst = |text| saying("units_metadata", text, Quantity::SeaSurfaceTemperature);
        let refused = sst("temperature: difference").unwrap_err().detail;
        assert!(refused.contains("differences"), "{refused}");
        assert!(sst("temperature: on_scale").is_ok() && sst("temperature: unknown").is_ok());
        let open = Quantity::open("bias", "degC", "Bias").unwrap();
        assert!(saying("units_metadata", "temperature: difference", open).is_ok());
    }

    #[test]
    fn spreads_and_extremes_are_not_taken_for_the_quantity() {
        for (methods, what) in [
            ("time: standard_deviation", "standard deviations"),
            ("area: mean t: maximum (interval: 1 day)", "highest values"),
            (
                "time: mean within years time: minimum over years",
                "lowest values",
            ),
        ] {
            let refused = said(methods, Quantity::CarbonFlux).unwrap_err().detail;
            assert!(
                refused.contains(what) && refused.contains("profile"),
                "{refused}"
            );
        }
        for methods in [
            "time: mean",
            "time: point",
            "area: standard_deviation",
            "lat: lon: maximum",
            "",
        ] {
            assert!(
                said(methods, Quantity::SeaSurfaceTemperature).is_ok(),
                "{methods}"
            );
        }
        let open = Quantity::open("gust", "m s-1", "Gusts").unwrap();
        assert!(said("time: maximum", open).is_ok());
    }
}
