//! Two versions of a product in; the times whose pictures differ out.

use contract::manifest::{Manifest, Step};
use contract::time::Period;

/// Times whose pictures the newer version draws from other values, in order and without overlap.
///
/// A picture is interpolated between the middles of two steps, so a step that changed reaches as far as its neighbours'
/// ends. Cells that hold data for the first time change how gaps are filled everywhere.
pub fn touched(before: Option<&Manifest>, now: &Manifest) -> Vec<Period> {
    let Some(extent) = now.extent() else {
        return vec![];
    };
    let Some(before) =
        before.filter(|before| before.domain == now.domain && before.grid == now.grid)
    else {
        return vec![extent];
    };
    let is_same = |i: usize| {
        let new = &now.steps[i];
        let old = before.step_of(new.period).map(|old| &before.steps[old]);
        old.is_some_and(|old| old.field == new.field)
    };
    let is_gone = |old: &Step| now.step_of(old.period).is_none();
    if before.steps.iter().any(is_gone) {
        return vec![extent];
    }
    let mut all: Vec<Period> = vec![];
    for i in (0..now.steps.len()).filter(|i| !is_same(*i)) {
        let reach = Period {
            start: now.steps[i.saturating_sub(1)].period.start,
            end: now.steps[(i + 1).min(now.steps.len() - 1)].period.end,
        };
        match all.last_mut() {
            Some(last) if last.end >= reach.start => last.end = last.end.max(reach.end),
            _ => all.push(reach),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::product::ProductId;
    use contract::quantity::Quantity;

    fn product() -> ProductId {
        "p".parse().unwrap()
    }

    fn month(number: usize) -> Period {
        let start = |month: usize| format!("2000-{month:02}").parse().unwrap();
        Period {
            start: start(number),
            end: start(number + 1),
        }
    }

    /// A version with a field a month, named by its content.
    fn manifest(contents: &[&str], domain: &str) -> Manifest {
        let step = |(i, content): (usize, &&str)| Step {
            masked: None,
            period: month(i + 1),
            field: ObjectKey::field(&product(), &Digest::of(content.as_bytes())),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            product: product(),
            number: 1,
            title: String::new(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: contents.iter().enumerate().map(step).collect(),
            domain: ObjectKey::domain(&product(), &Digest::of(domain.as_bytes())),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        }
    }

    fn span(first: usize, last: usize) -> Period {
        Period {
            start: month(first).start,
            end: month(last).end,
        }
    }

    #[test]
    fn a_changed_step_reaches_into_its_neighbours_and_no_farther() {
        let before = manifest(&["a", "b", "c", "d", "e", "f"], "d");
        let now = manifest(&["a", "B", "c", "d", "e", "F"], "d");
        assert_eq!(touched(Some(&before), &now), [span(1, 3), span(5, 6)]);
        assert_eq!(touched(Some(&before), &before), []);
    }

    #[test]
    fn a_new_step_touches_itself_and_the_one_before() {
        let before = manifest(&["a", "b", "c"], "d");
        let now = manifest(&["a", "b", "c", "x"], "d");
        assert_eq!(touched(Some(&before), &now), [span(3, 4)]);
    }

    #[test]
    fn new_cells_and_a_first_version_touch_everything() {
        let before = manifest(&["a", "b"], "d");
        let now = manifest(&["a", "b"], "wider");
        assert_eq!(touched(Some(&before), &now), [span(1, 2)]);
        assert_eq!(touched(None, &now), [span(1, 2)]);
    }
}
