//! What the codes of a mask mean: `flag_values` and `flag_meanings` of a variable in, an open quantity that keeps them out.

use contract::quantity::{Flag, MAX_FLAGS, OpenQuantity, OpenWords, Quantity};

use super::{PlannedStep, Planning};
use crate::inspect::file::description::Variable;
use crate::plan::cf::packing::{Packing, Unpacked};

/// The quantity with what the variable says of its codes. What cannot be kept is said, and the file lands without it.
pub(super) fn told(
    planning: &mut Planning<'_>,
    variable: &Variable,
    quantity: Quantity,
    (packing, steps): (&Packing, &[PlannedStep]),
) -> Quantity {
    let Quantity::Open(open) = quantity else {
        return quantity;
    };
    let told = of(variable, packing, steps).and_then(|flags| {
        let words = open.words().clone();
        let told = (!flags.is_empty()).then(|| OpenQuantity::new(OpenWords { flags, ..words }));
        told.transpose().map_err(|e| e.to_string())
    });
    match told {
        Ok(told) => Quantity::Open(told.unwrap_or(open)),
        Err(why) => {
            let name = &variable.name;
            planning.assume(format!("{name}: what its codes mean is left out: {why}"));
            quantity
        }
    }
}

/// Codes as stored values and their meanings, without those that mean no data; none if nothing is said of any.
fn of(variable: &Variable, packing: &Packing, steps: &[PlannedStep]) -> Result<Vec<Flag>, String> {
    let attributes = &variable.attributes;
    let Some(meanings) = attributes.text("flag_meanings") else {
        return Ok(vec![]);
    };
    if attributes.numbers("flag_masks").is_some() {
        return Err("flag_masks are of bits, of which a cell may have several".to_owned());
    }
    let meanings: Vec<&str> = meanings
        .split_whitespace()
        .take(MAX_FLAGS.saturating_add(1))
        .collect();
    let values = attributes.numbers("flag_values").unwrap_or_default();
    if meanings.len() > MAX_FLAGS || meanings.len() != values.len() {
        return Err(format!(
            "{} flag_values for {} words in flag_meanings, at most {MAX_FLAGS}",
            values.len(),
            if meanings.len() > MAX_FLAGS {
                "more".to_owned()
            } else {
                meanings.len().to_string()
            }
        ));
    }
    let (factor, offset) = steps
        .first()
        .map_or((1.0, 0.0), |step| (step.factor, step.offset));
    let mut flags = vec![];
    for (meaning, number) in meanings.into_iter().zip(values) {
        let Unpacked::Value(value) = packing.unpacked(number) else {
            continue;
        };
        // As values of fields: of 32 bits.
        let exact = value * factor + offset;
        let code = f64::from(exact as f32);
        if code.fract() != 0.0 || code.abs() > f64::from(i32::MAX) {
            return Err(format!("the code {code} is no whole number"));
        }
        if (exact - code).abs() > 0.5 {
            return Err(format!("float32 holds {code} and not the code {exact}"));
        }
        flags.push(Flag {
            value: code as i32,
            meaning: meaning.to_owned(),
        });
    }
    Flag::check(&flags)?;
    Ok(flags)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Kind};

    fn variable(meanings: &str, numbers: &[(&str, &[f64])]) -> Variable {
        let kind = Kind::Integer(1);
        let number = |(name, values): &(&str, &[f64])| {
            let bits = values.iter().map(|v| (*v).into()).collect();
            ((*name).to_owned(), AttributeValue::Numbers { kind, bits })
        };
        let text = AttributeValue::Text(meanings.to_owned());
        let meanings = ("flag_meanings".to_owned(), text);
        Variable {
            name: "basin".into(),
            dimensions: vec![],
            kind,
            attributes: numbers.iter().map(number).chain([meanings]).collect(),
        }
    }

    fn read(meanings: &str, numbers: &[(&str, &[f64])]) -> Result<Vec<(i32, String)>, String> {
        let variable = variable(meanings, numbers);
        let flags = of(&variable, &Packing::of(&variable), &[])?;
        Ok(flags
            .into_iter()
            .map(|flag| (flag.value, flag.meaning))
            .collect())
    }

    #[test]
    fn codes_have_the_meanings_that_stand_in_their_place() {
        let flags = read("atlantic pacific", &[("flag_values", &[1.0, 2.0])]).unwrap();
        let named = |value, meaning: &str| (value, meaning.to_owned());
        assert_eq!(flags, [named(1, "atlantic"), named(2, "pacific")]);
        // The fill value is no code, whatever it is called.
        let numbers: &[(&str, &[f64])] = &[("flag_values", &[0.0, 7.0]), ("_FillValue", &[0.0])];
        assert_eq!(read("none south", numbers).unwrap(), [named(7, "south")]);
        // Codes are values, packed or not.
        let packed: &[(&str, &[f64])] = &[("flag_values", &[1.0, 2.0]), ("scale_factor", &[10.0])];
        assert_eq!(
            read("a b", packed).unwrap(),
            [named(10, "a"), named(20, "b")]
        );
        let plain = Variable {
            attributes: [].into_iter().collect(),
            ..variable("", &[])
        };
        assert_eq!(of(&plain, &Packing::of(&plain), &[]), Ok(vec![]));
    }

    #[test]
    fn hostile_meanings_are_left_out_with_a_word() {
        let values = ("flag_values", &[1.0, 2.0][..]);
        let many = "a ".repeat(1_000_000);
        for (meanings, numbers, wanted) in [
            ("a b c", vec![values], "2 flag_values for 3 words"),
            ("a", vec![values], "2 flag_values for 1 words"),
            (many.as_str(), vec![values], "for more words"),
            ("a b", vec![], "0 flag_values"),
            ("", vec![values], "0 words"),
            ("a a", vec![values], "two codes mean"),
            (
                "a b",
                vec![("flag_values", &[1.0, 1.0][..])],
                "two meanings",
            ),
            (
                "a b",
                vec![("flag_values", &[1.0, 2.5][..])],
                "no whole number",
            ),
            (
                "a b",
                vec![("flag_values", &[1.0, 16_777_217.0][..])],
                "not the code 16777217",
            ),
            ("a \u{1b}[2J", vec![values], "no meaning"),
            ("a 2", vec![values], "no meaning"),
            ("a b", vec![("flag_masks", &[1.0, 2.0][..])], "of bits"),
        ] {
            let why = read(meanings, &numbers).unwrap_err();
            assert!(why.contains(wanted), "{why}");
        }
        let long = format!("a {}", "x".repeat(10_000));
        let why = read(&long, &[values]).unwrap_err();
        assert!(why.contains("no meaning") && why.len() < 200, "{why}");
    }
}
