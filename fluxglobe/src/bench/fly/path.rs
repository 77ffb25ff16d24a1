//! The way of a camera: around the earth, looking ahead, as time goes by.

use anyhow::{Context as _, Result};
use contract::time::TimeMs;
use serde::Deserialize;

use crate::cli::BenchFly;

/// How fast a camera goes, degrees of longitude a second, and the product's time with it.
const LON_DEG_PER_S: f64 = 6.0;
const DAYS_PER_S: f64 = 10.0;

#[derive(Debug, Deserialize)]
struct Listed {
    product: String,
    steps: Vec<Step>,
    modes: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct Products {
    products: Vec<Listed>,
}

#[derive(Debug, Deserialize)]
struct Step {
    start: TimeMs,
    end: TimeMs,
}

/// The way of one viewer's camera.
#[derive(Debug, Clone)]
pub(super) struct Path {
    /// Address without what changes.
    base: String,
    lon_deg: f64,
    first_ms: i64,
    span_ms: i64,
}

impl Path {
    /// Over the product that is asked for, or the first that is drawn in the mode.
    pub(super) async fn of(client: &reqwest::Client, options: &BenchFly) -> Result<Self> {
        let address = format!("{}/api/products", options.url);
        let answer = client.get(&address).send().await?.error_for_status()?;
        let Products { products } = serde_json::from_slice(&answer.bytes().await?)?;
        let mode = options.mode.to_string();
        let mut those = products.iter().filter(|one| one.modes.contains(&mode));
        let product = match &options.layer {
            Some(layer) => those.find(|one| one.product == layer.to_string()),
            None => those.next(),
        };
        let product = product.with_context(|| format!("no such product in the mode {mode}"))?;
        let first = product.steps.first().context("the product has no steps")?;
        let last = product.steps.last().context("the product has no steps")?;
        Ok(Self {
            base: format!(
                "/globe/{}/{mode}.png?lat={}&height_km={}&tilt={}&heading=90&width={}&height={}",
                product.product,
                options.lat,
                options.height_km,
                options.tilt,
                options.width,
                options.height
            ),
            lon_deg: options.lon,
            first_ms: first.start.ms(),
            span_ms: (last.end.ms() - first.start.ms()).max(1),
        })
    }

    /// Viewers are spread around the earth, so that no two see the same.
    pub(super) fn of_viewer(&self, number: u16) -> Self {
        Self {
            lon_deg: self.lon_deg + 137.508 * f64::from(number),
            ..self.clone()
        }
    }

    /// What the camera sees some seconds after the start.
    pub(super) fn view(&self, after_s: f64) -> String {
        let lon_deg = (self.lon_deg + LON_DEG_PER_S * after_s + 180.0).rem_euclid(360.0) - 180.0;
        let gone_ms = (after_s * DAYS_PER_S * 86_400_000.0) as i64 % self.span_ms;
        let time = TimeMs::new(self.first_ms + gone_ms);
        let time = time.map_or_else(|_beyond| String::new(), |time| time.to_string());
        format!("{}&lon={lon_deg:.4}&time={time}", self.base)
    }
}
