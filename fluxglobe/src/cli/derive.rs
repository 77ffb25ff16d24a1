//! Words of `fluxglobe derive`: products computed from others.

use anyhow::{Context as _, bail};
use clap::{Args, Subcommand};
use compute::computed::RequestedInput;
use compute::computed::co2_flux::{Below, Co2Flux, GasTransfer, Ice, Schmidt, Solubility, Source};
use contract::computed::{Matching, Regridding};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::TimeMs;

use super::brokers::brokers_alone;
use super::follow::Follow;

/// `fluxglobe derive`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_long_help = EXPRESSIONS
)]
pub(crate) struct Derive {
    #[command(subcommand)]
    pub(crate) what: Option<DeriveWhat>,
    #[command(flatten)]
    pub(crate) expression: Expression,
}

const EXPRESSIONS: &str = "\
An expression is computed in every cell of every period that its inputs have in common:

  fluxglobe derive --name sst-anomaly-to-foundation --quantity sea_surface_temperature \\
    --input skin=sst-2010 --expr \"skin + unit(0.17, 'K')\"

It is SQL's: + - * /, comparisons, AND OR NOT BETWEEN, CASE WHEN .. THEN .. ELSE .. END, abs sqrt power exp ln greatest
least coalesce, and the functions of the air-sea flux that `fluxglobe derive functions` lists with their papers.
Products are in SI units; a number with a unit is written unit(5, 'hPa'), and different units are never added.
Codes of a mask are compared, as in CASE WHEN basin = 5 THEN flux ELSE 0 END, and never computed with.
No data in an input is no data in the result, but where it stands in coalesce(ice, 0).
An input whose months hold in all of their days is marked :containing, one of one year that holds in every year
:climatology, one that holds always :any-time:

  --input salt=takahashi09-salinity:climatology --input land=onedeg-land:any-time

The result is a product: executors compute and store its steps, its manifest says what it was computed from, and asking
again computes what has changed since. What is made of the result (statistics of it, its carbon added up) stays of the
version before, and is named; with --follow it is made anew too, each after what it is made of:

  fluxglobe derive --name wind-squared --quantity \"wind_squared:m2 s-2\" \\
    --input wind=wind-2010 --expr \"wind * wind\" --follow";

/// What is derived.
#[derive(Debug, Subcommand)]
pub(crate) enum DeriveWhat {
    /// Carbon accumulated in every cell since a start: what lifts and sinks the particles.
    ///
    /// A step without data adds nothing: a cell that has data later is at 0 before its first, and one that has none since the start holds none.
    /// How many steps a sum holds is stored beside it, and `fluxglobe stats point` prints it.
    #[command(mut_args(brokers_alone))]
    Accumulated {
        /// Product, a carbon flux.
        #[arg(long)]
        product: ProductId,
        /// Where accumulation starts; the product's first instant if absent. A step that it lies in counts by its time after it.
        #[arg(long)]
        start: Option<TimeMs>,
        #[command(flatten)]
        follow: Follow,
        #[command(flatten, next_help_heading = "Kafka")]
        kafka: kafka_log::KafkaSettings,
    },
    /// Air-sea flux of CO2 from pressures, temperature, salinity, wind and ice: F = k (K0 pCO2 water - K0 pCO2 air) (1 - ice).
    #[command(name = "co2-flux")]
    Co2Flux(Box<DeriveCo2Flux>),
    /// A product brought to the grid of another.
    Regrid(Regrid),
    /// A statistic of each cell over time, as a product that is drawn and served like any other.
    Statistic(super::DeriveStatistic),
    /// List the functions that expressions may call, with units and papers.
    Functions,
}

/// An expression over products.
#[derive(Debug, Args)]
pub(crate) struct Expression {
    /// The expression, such as "wind * wind"; --help teaches it.
    #[arg(long, required = true, requires_all = ["name", "quantity"], allow_hyphen_values = true)]
    pub(crate) expr: Option<String>,
    /// Product to land the result in.
    #[arg(long)]
    pub(crate) name: Option<ProductId>,
    /// What the result is, such as `carbon_flux` (positive out of the sea) or `wind_speed`, or NAME:UNIT for anything else
    /// (`wind_moment2:m2 s-2`); its unit must be that of the expression.
    #[arg(long, value_parser = quantity)]
    pub(crate) quantity: Option<Quantity>,
    /// NAME=PRODUCT or NAME=PRODUCT:containing, :climatology or :any-time; a name each in the expression.
    #[arg(long = "input", value_parser = input, value_name = "NAME=PRODUCT[:MATCHING]")]
    pub(crate) inputs: Vec<RequestedInput>,
    #[command(flatten)]
    pub(crate) about: About,
}

/// What every computed product may be told.
#[derive(Debug, Args)]
#[command(mut_args(brokers_alone))]
pub(crate) struct About {
    /// Title of the product; made of what it is if absent.
    #[arg(long)]
    pub(crate) title: Option<String>,
    /// First instant; the first of the inputs if absent. Every step that reaches into the period is computed, and whole: of months
    /// --from 2004-08-02 has all of August.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after the period; a step that it lies in is computed whole.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    #[command(flatten)]
    pub(crate) follow: Follow,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

/// `fluxglobe derive regrid`.
#[derive(Debug, Args)]
pub(crate) struct Regrid {
    /// Product to bring over.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// Product whose grid it is brought to.
    #[arg(long)]
    pub(crate) like: ProductId,
    /// nearest, bilinear, or conservative: the mean by exact area of overlap on WGS84, which keeps integrals. Codes of a mask and days of the
    /// year have no means: nearest alone.
    #[arg(long)]
    pub(crate) method: Regridding,
    /// Least share of a cell that data must cover, 0 to 1; less is no data.
    #[arg(long, default_value_t = 0.5)]
    pub(crate) min_coverage: f64,
    /// Product to land the result in; PRODUCT-on-LIKE if absent.
    #[arg(long)]
    pub(crate) name: Option<ProductId>,
    #[command(flatten)]
    pub(crate) about: About,
}

/// `fluxglobe derive co2-flux`. Products may be marked as inputs of expressions are: PRODUCT:climatology.
#[derive(Debug, Args)]
pub(crate) struct DeriveCo2Flux {
    /// Product to land the flux in, kg m-2 s-1 of carbon, positive out of the sea.
    #[arg(long)]
    pub(crate) name: ProductId,
    /// Partial pressure of CO2 in water.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    pco2_water: Option<Source>,
    /// Fugacity of CO2 in water, in place of the partial pressure; that of air is then taken too.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    fco2_water: Option<Source>,
    /// Temperature that the pressure in water was measured at or holds for; it is brought to that below the skin
    /// (Takahashi et al. 2009).
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    temperature_of_pco2: Option<Source>,
    /// Partial pressure of CO2 in air at the surface.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    pco2_air: Option<Source>,
    /// Fugacity of CO2 in air at the surface.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    fco2_air: Option<Source>,
    /// Share of CO2 in dry air; with --pressure it gives the partial pressure in wet air.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    dry_mole_fraction: Option<Source>,
    /// Air pressure at sea level.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    pressure: Option<Source>,
    /// Temperature of the skin, or the only one that there is.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    temperature: Source,
    /// Temperature below the skin: subskin or foundation. That of the skin if absent (the bulk formula).
    #[arg(long, value_parser = source, value_name = "PRODUCT", conflicts_with_all = ["cool_skin_k", "cool_skin_donlon2002"])]
    below: Option<Source>,
    /// Below the skin it is so many kelvin warmer, such as 0.17.
    #[arg(long, value_name = "K", conflicts_with = "cool_skin_donlon2002")]
    cool_skin_k: Option<f64>,
    /// Below the skin it is warmer by the cool skin of Donlon et al. (2002), which depends on --wind.
    #[arg(long)]
    cool_skin_donlon2002: bool,
    /// Salinity.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    salinity: Source,
    /// How much saltier the skin is, such as 0.1.
    #[arg(long, default_value_t = 0.0)]
    salty_skin: f64,
    /// Mean wind speed at 10 m.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    wind: Option<Source>,
    /// Mean of its square; where a velocity needs it and it is not given, that of Rayleigh's distribution, 4/pi U².
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    wind_moment2: Option<Source>,
    /// Mean of its cube; else that of Rayleigh's distribution, 6/pi U³.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    wind_moment3: Option<Source>,
    /// Share of ice; all is open water if absent.
    #[arg(long, value_parser = source, value_name = "PRODUCT")]
    ice: Option<Source>,
    /// How ice closes the sea.
    #[arg(long, value_enum, default_value_t)]
    ice_rule: Ice,
    /// Cells whose ice is not known are open sea.
    #[arg(long)]
    no_ice_is_open: bool,
    /// Gas-transfer velocity.
    #[arg(long = "k", value_enum, default_value_t)]
    gas_transfer: GasTransfer,
    /// Schmidt number.
    #[arg(long, value_enum, default_value_t)]
    schmidt: Schmidt,
    /// Solubility, of Weiss (1974).
    #[arg(long, value_enum, default_value_t)]
    solubility: Solubility,
    #[command(flatten)]
    pub(crate) about: About,
}

impl DeriveCo2Flux {
    /// Products and choices of the computation.
    pub(crate) fn flux(&self) -> Co2Flux {
        let optional = [
            ("pco2_water", &self.pco2_water),
            ("fco2_water", &self.fco2_water),
            ("temperature_of_pco2", &self.temperature_of_pco2),
            ("pco2_air", &self.pco2_air),
            ("fco2_air", &self.fco2_air),
            ("dry_mole_fraction", &self.dry_mole_fraction),
            ("pressure", &self.pressure),
            ("below", &self.below),
            ("wind", &self.wind),
            ("wind_moment2", &self.wind_moment2),
            ("wind_moment3", &self.wind_moment3),
            ("ice", &self.ice),
        ];
        let given = optional
            .into_iter()
            .filter_map(|(name, source)| Some((name, source.clone()?)));
        let needed = [
            ("temperature", self.temperature.clone()),
            ("salinity", self.salinity.clone()),
        ];
        let below = match (self.cool_skin_k, &self.below) {
            (Some(by_k), _) => Below::Warmer { by_k },
            (None, Some(_)) => Below::Product,
            (None, None) if self.cool_skin_donlon2002 => Below::Donlon2002,
            (None, None) => Below::Skin,
        };
        Co2Flux {
            sources: given.chain(needed).collect(),
            gas_transfer: self.gas_transfer,
            schmidt: self.schmidt,
            solubility: self.solubility,
            ice: self.ice_rule,
            no_ice_is_open: self.no_ice_is_open,
            below,
            salty_skin: self.salty_skin,
        }
    }
}

/// A quantity by its name in manifests, or `NAME:UNIT` for one that nothing is built in for.
fn quantity(text: &str) -> anyhow::Result<Quantity> {
    if let Some((name, unit)) = text.split_once(':') {
        return Ok(Quantity::open(name, unit, &name.replace('_', " "))?);
    }
    let known = || {
        let names = Quantity::ALL.map(|quantity| serde_json::json!(quantity).to_string());
        names.join(", ").replace('"', "")
    };
    serde_json::from_value(serde_json::Value::from(text))
        .with_context(|| format!("there are {}, and NAME:UNIT for anything else", known()))
}

/// `PRODUCT` or `PRODUCT:MATCHING`.
fn source(text: &str) -> anyhow::Result<Source> {
    Ok(match text.split_once(':') {
        Some((product, matching)) => (product.parse()?, matching.parse()?),
        None => (text.parse()?, Matching::default()),
    })
}

/// `NAME=PRODUCT[:MATCHING]`.
fn input(text: &str) -> anyhow::Result<RequestedInput> {
    let (name, of) = text
        .split_once('=')
        .context("an input is NAME=PRODUCT, such as sst=sst-2010")?;
    let is_name = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.len() <= 64
        && name
            .bytes()
            .all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_'));
    if !is_name {
        bail!("a name is of a-z, 0-9 and _, and starts with a letter");
    }
    let (product, matching) = source(of)?;
    Ok(RequestedInput {
        name: name.to_owned(),
        product,
        matching,
    })
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        expression: Expression,
    }

    #[test]
    fn an_expression_may_begin_with_a_minus() {
        let words = "derive --name open --quantity open:1 --input ice=sea-ice --expr";
        let line = words.split(' ').chain(["-ice + 1"]);
        let line = Line::try_parse_from(line).unwrap();
        assert_eq!(line.expression.expr.as_deref(), Some("-ice + 1"));
    }
}
