use super::*;
use contract::manifest::MANIFEST_SCHEMA;
use contract::quantity::Quantity;

fn one_degree(rows: u32) -> Grid {
    Grid {
        rows,
        cols: 4,
        north_deg: 10.0,
        west_deg: 0.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    }
}

fn input(name: &str, grid: Grid, periods: &[Period], matching: Matching) -> Input {
    let step = |period: &Period| Step {
        masked: None,
        period: *period,
        field: ObjectKey::field(&name.parse().unwrap(), &Digest::of_json(&(name, period))),
        raw_sha256: Digest::of(b""),
        origin: format!("{name}.nc"),
        valid_cells: 1,
        contributed: None,
    };
    Input {
        name: name.to_owned(),
        matching,
        manifest: Manifest {
            schema: MANIFEST_SCHEMA,
            product: name.parse().unwrap(),
            number: 1,
            title: String::new(),
            quantity: Quantity::WindSpeed,
            synthetic: false,
            source: String::new(),
            grid,
            steps: periods.iter().map(step).collect(),
            domain: ObjectKey::domain(&name.parse().unwrap(), &Digest::of(b"")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        },
    }
}

fn months(year: i32, of: std::ops::RangeInclusive<u32>) -> Vec<Period> {
    of.map(|month| Period::month(year, month).unwrap())
        .collect()
}

fn said(result: Result<impl std::fmt::Debug, ComputeError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn periods_of_all_are_matched_a_climatology_by_month_and_a_mask_always() {
    let grid = one_degree(3);
    let same = Matching::SamePeriod;
    let year = [months(2010, 1..=12), months(2011, 1..=3)].concat();
    let inputs = [
        input(
            "mask",
            grid,
            &[Period::year(1988).unwrap()],
            Matching::AnyTime,
        ),
        input("wind", grid, &year, same),
        input("sst", grid, &months(2010, 2..=12), same),
        input("salt", grid, &months(2000, 1..=12), Matching::MonthOfYear),
    ];
    let found = steps(&inputs, (None, None)).unwrap();
    assert_eq!((found.steps.len(), found.left_out), (11, 4));
    let march = &found.steps[1];
    assert_eq!(march.period, Period::month(2010, 3).unwrap());
    assert_eq!(march.fields[0], inputs[0].manifest.steps[0].field);
    assert_eq!(march.fields[3], inputs[3].manifest.steps[2].field);
    assert_eq!(march.origin, "wind.nc");
    let window = (
        Some("2010-06".parse().unwrap()),
        Some("2010-08".parse().unwrap()),
    );
    assert_eq!(steps(&inputs, window).unwrap().steps.len(), 2);
}

#[test]
fn days_take_the_month_that_they_lie_in_and_weeks_over_its_end_none() {
    let grid = one_degree(3);
    let days = |text: &str, count: i64| {
        let start: TimeMs = text.parse().unwrap();
        let end = TimeMs::new(start.ms() + count * 86_400_000).unwrap();
        Period::new(start, end).unwrap()
    };
    let periods = [
        days("2010-01-31", 1),
        days("2010-02-01", 1),
        days("2010-02-26", 7),
        days("2010-05-02", 1),
    ];
    let inputs = [
        input("wind", grid, &periods, Matching::SamePeriod),
        input("sst", grid, &months(2010, 1..=4), Matching::Containing),
        input("salt", grid, &months(2000, 1..=12), Matching::MonthOfYear),
    ];
    let found = steps(&inputs, (None, None)).unwrap();
    // The week ends in March; the input has no May.
    assert_eq!((found.steps.len(), found.left_out), (2, 2));
    for (step, month) in found.steps.iter().zip([0, 1]) {
        for of in [1, 2] {
            let own = &inputs[of].manifest.steps[month];
            assert_eq!(step.fields[of], own.field, "{of} in month {month}");
        }
    }
    let early = [days("2009-12-31", 1)];
    let wind = input("wind", grid, &early, Matching::SamePeriod);
    let text = said(steps(&[wind, inputs[1].clone()], (None, None)));
    assert!(text.contains("marked containing"), "{text}");
}

#[test]
fn what_does_not_belong_together_is_refused_with_what_to_write() {
    let (grid, same) = (one_degree(3), Matching::SamePeriod);
    let monthly = input("wind", grid, &months(2010, 1..=12), same);
    let elsewhere = input("sst", one_degree(5), &months(2010, 1..=12), same);
    let text = said(shared_grid(&[monthly.clone(), elsewhere]));
    assert!(
        text.contains("fluxglobe derive regrid --product sst --like wind --method conservative"),
        "{text}"
    );
    let noisy = Grid {
        dlat_deg: 1.0 + 1e-9,
        north_deg: 10.0 - 1e-7,
        ..grid
    };
    let near = input("sst", noisy, &months(2010, 1..=12), same);
    assert_eq!(shared_grid(&[monthly.clone(), near]).unwrap(), grid);

    let other_year = input("sst", grid, &months(2000, 1..=12), same);
    let text = said(steps(&[monthly.clone(), other_year], (None, None)));
    assert!(text.contains("no period that all inputs have"), "{text}");
    assert!(text.contains("in every year climatology"), "{text}");
    let part = input("salt", grid, &months(2000, 2..=12), Matching::MonthOfYear);
    assert!(said(steps(&[monthly.clone(), part], (None, None))).contains("no climatology"));
    let many = input("mask", grid, &months(2000, 1..=2), Matching::AnyTime);
    assert!(said(steps(&[monthly, many.clone()], (None, None))).contains("2 steps"));
    assert!(said(steps(&[many], (None, None))).contains("which periods"));
    assert!(said(shared_grid(&[])).contains("no product"));
}

/// A month of a product, by the name that an expression has for it.
fn of(name: &str, quantity: Quantity) -> Input {
    let month = months(2010, 1..=1);
    let mut input = input("p", one_degree(3), &month, Matching::SamePeriod);
    input.name = name.to_owned();
    input.manifest.quantity = quantity;
    input
}

#[test]
fn partial_pressure_and_fugacity_are_not_mixed_unless_one_is_converted() {
    let ask = |inputs: &[Input], expression: &str| {
        let expression = expression.to_owned();
        pressures_of_a_kind(inputs, &Computation::Expression { expression })
    };
    let both = [of("water", Quantity::Fco2), of("air", Quantity::Pco2)];
    assert!(said(ask(&both, "water - air")).contains("fco2_of_pco2_weiss1974"));
    ask(&both, "water - fco2_of_pco2_weiss1974(air, t, p)").unwrap();
    ask(&both[..1], "water").unwrap();
    let named = [of("pco2_water", Quantity::Fco2)];
    let told = said(ask(&named, "pco2_water"));
    assert!(
        told.contains("pco2_water holds CO₂ fugacity") && told.contains("--fco2-water"),
        "{told}"
    );
}

#[test]
fn water_is_no_air_and_the_skin_is_not_below_itself() {
    let open = |place: &str| {
        let name = format!("surface_partial_pressure_of_carbon_dioxide_in_{place}");
        Quantity::open(&name, "Pa", "Pressure").unwrap()
    };
    let [skin, foundation] = [
        Quantity::SeaSurfaceSkinTemperature,
        Quantity::SeaSurfaceFoundationTemperature,
    ];
    let water = || of("pco2_water", open("sea_water"));
    let right = [
        water(),
        of("pco2_air", open("air")),
        of("temperature", skin),
        of("below", foundation),
    ];
    places_of_a_kind(&right).unwrap();
    places_of_a_kind(&[water(), of("temperature", foundation)]).unwrap();
    for (inputs, reason) in [
        (
            vec![of("pco2_water", open("air"))],
            "p is given as pco2_water and is of air",
        ),
        (
            vec![water(), of("pco2_air", open("sea_water"))],
            "is of sea water",
        ),
        (
            vec![water(), of("temperature", foundation), of("below", skin)],
            "give it as --temperature",
        ),
        (
            vec![
                water(),
                of("temperature", foundation),
                of("below", Quantity::SeaSurfaceTemperature),
            ],
            "give it as --below",
        ),
    ] {
        let refused = said(places_of_a_kind(&inputs));
        assert!(refused.contains(reason), "{refused}");
    }
    // Whoever writes an expression calls things as he likes.
    places_of_a_kind(&[of("below", skin), of("temperature", foundation)]).unwrap();
}
