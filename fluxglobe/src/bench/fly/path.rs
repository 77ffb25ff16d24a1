//! The way of a camera: around the earth, looking ahead, as time goes by.

use anyhow::Result;

use crate::bench::listed::{Span, listed};
use crate::cli::BenchFly;

/// How fast a camera goes, degrees of longitude a second, and the product's time with it.
const LON_DEG_PER_S: f64 = 6.0;
const DAYS_PER_S: f64 = 10.0;

/// The way of one viewer's camera.
#[derive(Debug, Clone)]
pub(super) struct Path {
    /// Address without what changes.
    base: String,
    lon_deg: f64,
    span: Span,
}

impl Path {
    /// Over the product that is asked for, or the first that is drawn in the mode.
    pub(super) async fn of(client: &reqwest::Client, options: &BenchFly) -> Result<Self> {
        let mode = options.mode;
        let product = listed(client, &options.url, options.layer.as_ref(), mode).await?;
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
            span: product.span()?,
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
        let time = self
            .span
            .at_ms((after_s * DAYS_PER_S * 86_400_000.0) as u64);
        format!("{}&lon={lon_deg:.4}&time={time}", self.base)
    }
}
