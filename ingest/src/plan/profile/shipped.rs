//! The profiles that come with the program.

use std::sync::LazyLock;

use super::Profile;

/// Name and text of each, in the order in which they are tried.
const TEXTS: [(&str, &str); 34] = [
    (
        "takahashi09-flux",
        include_str!("../../../profiles/takahashi09-flux.toml"),
    ),
    (
        "takahashi09-pco2",
        include_str!("../../../profiles/takahashi09-pco2.toml"),
    ),
    ("sst-2010", include_str!("../../../profiles/sst-2010.toml")),
    (
        "chlorophyll-2010",
        include_str!("../../../profiles/chlorophyll-2010.toml"),
    ),
    (
        "wind-2010",
        include_str!("../../../profiles/wind-2010.toml"),
    ),
    (
        "socatv4-fco2-2010",
        include_str!("../../../profiles/socatv4-fco2-2010.toml"),
    ),
    ("ice-2010", include_str!("../../../profiles/ice-2010.toml")),
    (
        "air-pressure-2010",
        include_str!("../../../profiles/air-pressure-2010.toml"),
    ),
    (
        "wave-height-2010",
        include_str!("../../../profiles/wave-height-2010.toml"),
    ),
    (
        "rain-gpcp-2010",
        include_str!("../../../profiles/rain-gpcp-2010.toml"),
    ),
    (
        "woa18-salinity",
        include_str!("../../../profiles/woa18-salinity.toml"),
    ),
    (
        "reynolds-sst",
        include_str!("../../../profiles/reynolds-sst.toml"),
    ),
    (
        "ccmp-wind",
        include_str!("../../../profiles/ccmp-wind.toml"),
    ),
    (
        "ostia-sst-climatology",
        include_str!("../../../profiles/ostia-sst-climatology.toml"),
    ),
    (
        "air-pressure-oceanflux",
        include_str!("../../../profiles/air-pressure-oceanflux.toml"),
    ),
    (
        "china-sea-synthetic",
        include_str!("../../../profiles/china-sea-synthetic.toml"),
    ),
    (
        "globe-synthetic",
        include_str!("../../../profiles/globe-synthetic.toml"),
    ),
    (
        "globcurrent-east",
        include_str!("../../../profiles/globcurrent-east.toml"),
    ),
    (
        "globcurrent-north",
        include_str!("../../../profiles/globcurrent-north.toml"),
    ),
    (
        "takahashi09-salinity",
        include_str!("../../../profiles/takahashi09-salinity.toml"),
    ),
    (
        "takahashi09-sst",
        include_str!("../../../profiles/takahashi09-sst.toml"),
    ),
    (
        "takahashi09-wind",
        include_str!("../../../profiles/takahashi09-wind.toml"),
    ),
    (
        "takahashi09-pressure",
        include_str!("../../../profiles/takahashi09-pressure.toml"),
    ),
    (
        "takahashi09-ice",
        include_str!("../../../profiles/takahashi09-ice.toml"),
    ),
    (
        "takahashi09-pco2-air",
        include_str!("../../../profiles/takahashi09-pco2-air.toml"),
    ),
    ("etopo20", include_str!("../../../profiles/etopo20.toml")),
    ("etopo5", include_str!("../../../profiles/etopo5.toml")),
    (
        "onedeg-land",
        include_str!("../../../profiles/onedeg-land.toml"),
    ),
    (
        "reccap2-basins",
        include_str!("../../../profiles/reccap2-basins.toml"),
    ),
    (
        "ostia-sst",
        include_str!("../../../profiles/ostia-sst.toml"),
    ),
    (
        "modis-aqua-sst-month",
        include_str!("../../../profiles/modis-aqua-sst-month.toml"),
    ),
    (
        "modis-aqua-sst-8day",
        include_str!("../../../profiles/modis-aqua-sst-8day.toml"),
    ),
    (
        "ghrsst-l3-sst",
        include_str!("../../../profiles/ghrsst-l3-sst.toml"),
    ),
    (
        "ghrsst-l4-sst",
        include_str!("../../../profiles/ghrsst-l4-sst.toml"),
    ),
];

static SHIPPED: LazyLock<Vec<Profile>> = LazyLock::new(|| {
    let parse = |(name, text): &(&str, &str)| {
        Profile::parse(name, text).expect("shipped profiles are parsed by a test")
    };
    TEXTS.iter().map(parse).collect()
});

/// The shipped profiles; of those that are for a file the first is taken.
pub fn shipped() -> &'static [Profile] {
    &SHIPPED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_profile_parses_under_its_own_name() {
        for (name, text) in TEXTS {
            let profile = Profile::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(profile.name, name);
        }
        assert_eq!(shipped().len(), TEXTS.len());
    }

    #[test]
    fn a_profile_with_a_spelling_mistake_is_refused_with_the_field() {
        let text = TEXTS[0].1.replace("registration", "registratoin");
        let error = Profile::parse("p", &text).unwrap_err().to_string();
        assert!(error.contains("registratoin"), "{error}");
        let text = TEXTS[0].1.replace("g C m-2 month-1", "g C m-2 fortnight-1");
        assert!(
            Profile::parse("p", &text)
                .unwrap_err()
                .to_string()
                .contains("fortnight")
        );
    }
}
