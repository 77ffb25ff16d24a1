//! What a server counts: the text of its `/metrics` in, numbers by name out.

use std::collections::BTreeMap;

/// One reading of `/metrics`: every line's value under its name with its labels.
#[derive(Debug, Clone, Default)]
pub(super) struct Figures(BTreeMap<String, f64>);

impl Figures {
    /// Lines that are no figures are passed over.
    pub(super) fn parse(text: &str) -> Self {
        let figure = |line: &str| {
            let (name, value) = line.rsplit_once(' ')?;
            Some((name.to_owned(), value.parse().ok()?))
        };
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        Self(lines.filter_map(figure).collect())
    }

    /// The sum of a figure over its labels, of those that have this one if there is one; none if it is not told.
    pub(super) fn sum(&self, name: &str, label: &str) -> Option<f64> {
        let is_it = |known: &str| {
            let rest = known.strip_prefix(name);
            let rest = rest.filter(|rest| rest.is_empty() || rest.starts_with('{'));
            rest.is_some_and(|rest| rest.contains(label))
        };
        let found = self.0.iter().filter(|(known, _)| is_it(known));
        found.map(|(_, value)| *value).reduce(|sum, one| sum + one)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_summed_over_their_labels() {
        let figures = Figures::parse(
            "# HELP a_total what\na_total 2\nb_total{k=\"x\",l=\"1\"} 1.5\nb_total{k=\"y\",l=\"1\"} 2\nb_totals 7\nnothing\n",
        );
        assert_eq!(figures.sum("a_total", ""), Some(2.0));
        assert_eq!(figures.sum("b_total", ""), Some(3.5));
        assert_eq!(figures.sum("b_total", "k=\"y\""), Some(2.0));
        assert_eq!(figures.sum("c_total", ""), None);
        assert_eq!(figures.sum("a_total", "k="), None);
    }
}
