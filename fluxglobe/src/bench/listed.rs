//! The products that a running server lists: an address in, the product to measure with out.

use anyhow::{Context as _, Result, bail};
use contract::job::Mode;
use contract::product::ProductId;
use contract::time::TimeMs;
use serde::Deserialize;

/// A product as `/api/products` describes it.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Listed {
    pub(super) product: String,
    /// West, south, east, north, degrees.
    pub(super) bounds_deg: [f64; 4],
    steps: Vec<ListedStep>,
    modes: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct Products {
    products: Vec<Listed>,
}

#[derive(Debug, Clone, Deserialize)]
struct ListedStep {
    start: TimeMs,
    end: TimeMs,
}

/// The time in which every instant of a product is a picture of its own: from the middle of its first step to that of its last.
/// All of its time, if there is one step alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    first_ms: i64,
    length_ms: u64,
}

/// The product that is asked for, or the first that is drawn in the mode.
pub(super) async fn listed(
    client: &reqwest::Client,
    url: &str,
    layer: Option<&ProductId>,
    mode: Mode,
) -> Result<Listed> {
    let answer = client.get(format!("{url}/api/products")).send().await;
    let answer = answer
        .with_context(|| format!("no server answers at {url}; start one with `fluxglobe serve`"))?
        .error_for_status()?;
    let Products { products } = serde_json::from_slice(&answer.bytes().await?)?;
    chosen(products, layer, mode)
}

fn chosen(products: Vec<Listed>, layer: Option<&ProductId>, mode: Mode) -> Result<Listed> {
    let mode = &mode.to_string();
    let names: Vec<String> = products.iter().map(|one| one.product.clone()).collect();
    let mut those = products.into_iter().filter(|one| one.modes.contains(mode));
    let found = match layer {
        Some(layer) => those.find(|one| one.product == layer.to_string()),
        None => those.next(),
    };
    found.with_context(|| {
        let wanted = layer.map_or("no product".to_owned(), |layer| {
            format!("no product {layer}")
        });
        format!(
            "{wanted} is there in the mode {mode}; there are {}",
            names.join(", ")
        )
    })
}

impl Listed {
    /// The time in which it changes.
    pub(super) fn span(&self) -> Result<Span> {
        let middle_ms = |step: &ListedStep| i64::midpoint(step.start.ms(), step.end.ms());
        let (first_ms, end_ms) = match &self.steps[..] {
            [] => bail!("the product has no steps"),
            [only] => (only.start.ms(), only.end.ms()),
            [first, .., last] => (middle_ms(first), middle_ms(last)),
        };
        let length_ms = u64::try_from(end_ms - first_ms).ok();
        let length_ms = length_ms.filter(|length| *length > 0);
        Ok(Span {
            first_ms,
            length_ms: length_ms.context("the product ends before it begins")?,
        })
    }
}

impl Span {
    /// The instant at a share of the whole, in units of 2^-64, as it stands in addresses.
    pub(super) fn at_share(self, share: u64) -> String {
        self.at_ms(((u128::from(share) * u128::from(self.length_ms)) >> 64) as u64)
    }

    /// The instant so long after the start, begun anew after the end, as it stands in addresses.
    pub(super) fn at_ms(self, after_ms: u64) -> String {
        let after_ms = (after_ms % self.length_ms) as i64;
        let time = TimeMs::new(self.first_ms + after_ms);
        time.map_or_else(|_beyond| String::new(), |time| time.to_string())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A product of the China Seas over two months.
    pub(crate) fn product() -> Listed {
        serde_json::from_str(
            r#"{"product": "p", "bounds_deg": [100, 0, 130, 40], "modes": ["map", "volume"],
                "steps": [{"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z"},
                          {"start": "2000-02-01T00:00:00Z", "end": "2000-03-01T00:00:00Z"}]}"#,
        )
        .unwrap()
    }

    #[test]
    fn a_product_that_is_not_there_is_told_with_those_that_are() {
        let layer = "q".parse().unwrap();
        let error = chosen(vec![product()], Some(&layer), Mode::Volume).unwrap_err();
        assert!(
            error.to_string().contains("no product q is there"),
            "{error}"
        );
        assert!(error.to_string().contains("there are p"), "{error}");
        assert!(chosen(vec![product()], None, Mode::Flow).is_err());
        let found = chosen(vec![product()], None, Mode::Volume).unwrap();
        assert_eq!(found.product, "p");
    }

    #[test]
    fn instants_lie_in_the_span_and_begin_anew_after_its_end() {
        let span = product().span().unwrap();
        assert_eq!(span.at_share(0), "2000-01-16T12:00:00Z");
        assert!(span.at_share(u64::MAX).starts_with("2000-02-15T11:59:59"));
        let day_ms = 86_400_000;
        assert_eq!(span.at_ms(10 * day_ms), "2000-01-26T12:00:00Z");
        assert_eq!(span.at_ms(31 * day_ms), "2000-01-17T12:00:00Z");
    }
}
