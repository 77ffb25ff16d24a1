//! The structs and constants of Rust and WGSL, compared through naga.

use render::passes::{scatter, splat, trails};
use render::stages::fill::level::{FillLevel, MOST_REACH_COLS};
use render::stages::fill::{self, exact, window};
use render::stages::layout::{
    Axis, Col, DEPTH_ONE, Entry, GROUP, GroundAxis, KERNEL_BALL, KERNEL_CLOUD, KERNEL_DOT,
    LIGHT_ALONE, LIGHT_GIVEN, LIGHT_OFF, LIGHT_OWN, MISSING, MOST_HOT_PARTS, NO_LIST, PART_ENTRIES,
    Params, Particle, Row, SCREEN_TILE_PX, SCREEN_TILE_SHIFT, SQUARE, SUBPIXELS, Splat, VIEW_GLOBE,
    VIEW_TILE, Velocity, WATER_BLUE, WATER_GREEN, WATER_RED,
};
use render::stages::{bin, compose, eye, flow, interpolate, light, map};

type Fields = &'static [(&'static str, usize, &'static str)];

fn module(source: &str) -> naga::Module {
    naga::front::wgsl::parse_str(source).unwrap()
}

/// What differs between a Rust struct and its mirror, if anything does.
fn difference(source: &str, name: &str, fields: Fields, size: usize) -> Option<String> {
    let module = module(source);
    let found = module
        .types
        .iter()
        .find(|(_, ty)| ty.name.as_deref() == Some(name));
    let Some((
        _,
        naga::Type {
            inner: naga::TypeInner::Struct { members, span },
            ..
        },
    )) = found
    else {
        return Some(format!("no struct {name}"));
    };
    let scalar = |kind: &str| match kind {
        "u32" => naga::Scalar::U32,
        "i32" => naga::Scalar::I32,
        _ => naga::Scalar::F32,
    };
    let same = |member: &naga::StructMember, (name, offset, kind): &(&str, usize, &str)| {
        member.name.as_deref() == Some(name)
            && member.offset as usize == *offset
            && module.types[member.ty].inner == naga::TypeInner::Scalar(scalar(kind))
    };
    let wrong = members
        .iter()
        .zip(fields)
        .find(|(member, field)| !same(member, field));
    if let Some((member, field)) = wrong {
        return Some(format!("{name}: {member:?} against {field:?}"));
    }
    let complete = members.len() == fields.len() && *span as usize == size;
    (!complete).then(|| {
        format!(
            "{name}: {} fields, {span} bytes against {}, {size}",
            members.len(),
            fields.len()
        )
    })
}

const SHARED: [(&str, Fields, usize); 9] = [
    ("Params", Params::FIELDS, size_of::<Params>()),
    ("Row", Row::FIELDS, size_of::<Row>()),
    ("Col", Col::FIELDS, size_of::<Col>()),
    ("Particle", Particle::FIELDS, size_of::<Particle>()),
    ("Splat", Splat::FIELDS, size_of::<Splat>()),
    ("Entry", Entry::FIELDS, size_of::<Entry>()),
    ("Velocity", Velocity::FIELDS, size_of::<Velocity>()),
    ("Axis", Axis::FIELDS, size_of::<Axis>()),
    ("GroundAxis", GroundAxis::FIELDS, size_of::<GroundAxis>()),
];

#[test]
fn structs_have_the_same_fields_in_rust_and_wgsl() {
    for (name, fields, size) in SHARED {
        assert_eq!(difference(eye::SOURCE, name, fields, size), None);
    }
    let fills = [fill::STENCIL_SOURCE, window::SOURCE, exact::SOURCE];
    for source in fills {
        let size = size_of::<FillLevel>();
        assert_eq!(
            difference(source, "FillLevel", FillLevel::FIELDS, size),
            None
        );
    }
}

#[test]
fn a_swapped_or_missing_field_is_seen() {
    for (right, wrong) in [
        ("rows: u32, cols: u32", "cols: u32, rows: u32"),
        ("rows: u32, ", ""),
        ("rows: u32", "rows: f32"),
    ] {
        // A shader that does not read the field.
        let source = light::SOURCE.replacen(right, wrong, 1);
        assert_ne!(source, light::SOURCE);
        assert!(
            difference(&source, "Params", Params::FIELDS, size_of::<Params>()).is_some(),
            "{wrong}"
        );
    }
}

#[test]
fn constants_have_the_same_value_in_rust_and_wgsl() {
    let constant = |source: &str, name: &str| {
        let module = module(source);
        let (_, constant) = module
            .constants
            .iter()
            .find(|(_, c)| c.name.as_deref() == Some(name))
            .unwrap();
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::U32(v)) => f64::from(v),
            naga::Expression::Literal(naga::Literal::I32(v)) => f64::from(v),
            naga::Expression::Literal(naga::Literal::F32(v)) => f64::from(v),
            naga::Expression::Literal(naga::Literal::AbstractInt(v)) => v as f64,
            naga::Expression::Literal(naga::Literal::AbstractFloat(v)) => f64::from(v as f32),
            ref other => panic!("{name} is {other:?}"),
        }
    };
    let wgsl = |name: &str| constant(eye::SOURCE, name);
    for (name, value) in [
        ("GROUP", f64::from(GROUP)),
        ("SQUARE", f64::from(SQUARE)),
        ("SCREEN_TILE_PX", f64::from(SCREEN_TILE_PX)),
        ("SCREEN_TILE_SHIFT", f64::from(SCREEN_TILE_SHIFT)),
        ("SUBPIXELS", f64::from(SUBPIXELS)),
        ("DEPTH_ONE", f64::from(DEPTH_ONE)),
        ("PART_ENTRIES", f64::from(PART_ENTRIES)),
        ("MOST_HOT_PARTS", f64::from(MOST_HOT_PARTS)),
        ("NO_LIST", f64::from(NO_LIST)),
        ("MISSING", f64::from(MISSING)),
        ("WATER_RED", f64::from(WATER_RED)),
        ("WATER_GREEN", f64::from(WATER_GREEN)),
        ("WATER_BLUE", f64::from(WATER_BLUE)),
        ("VIEW_TILE", f64::from(VIEW_TILE)),
        ("VIEW_GLOBE", f64::from(VIEW_GLOBE)),
        ("LIGHT_OFF", f64::from(LIGHT_OFF)),
        ("LIGHT_OWN", f64::from(LIGHT_OWN)),
        ("LIGHT_GIVEN", f64::from(LIGHT_GIVEN)),
        ("LIGHT_ALONE", f64::from(LIGHT_ALONE)),
        ("KERNEL_DOT", f64::from(KERNEL_DOT)),
        ("KERNEL_BALL", f64::from(KERNEL_BALL)),
        ("KERNEL_CLOUD", f64::from(KERNEL_CLOUD)),
    ] {
        assert!(
            (wgsl(name) - value).abs() <= value.abs() * 1e-7,
            "{name}: {} against {value}",
            wgsl(name)
        );
    }
    let width = constant(fill::STENCIL_SOURCE, "WIDTH");
    let segment = constant(fill::STENCIL_SOURCE, "SEGMENT");
    assert_eq!(segment as u32, width as u32 + 2 * MOST_REACH_COLS);
    assert_eq!(SCREEN_TILE_PX as i32 * SUBPIXELS, 1 << SCREEN_TILE_SHIFT);
}

#[test]
fn every_shader_is_valid_without_extensions() {
    let sources = [
        interpolate::SOURCE,
        splat::SOURCE,
        flow::SOURCE,
        trails::SOURCE,
        fill::STENCIL_SOURCE,
        window::SOURCE,
        exact::SOURCE,
        light::SOURCE,
        bin::SOURCE,
        scatter::SOURCE,
        eye::SOURCE,
        map::SOURCE,
        compose::SOURCE,
    ];
    for source in sources {
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        let module = module(source);
        validator.validate(&module).unwrap();
        assert!(!module.entry_points.is_empty());
    }
}
