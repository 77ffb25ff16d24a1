//! The structs and constants of Rust and WGSL, compared through naga.

use std::collections::BTreeSet;

use render::gpu::FIRST_UNIFORM;
use render::passes::{scatter, splat, trails};
use render::stages::features::{self, Features};
use render::stages::fill::level::{FillLevel, MOST_REACH_COLS};
use render::stages::fill::{self, exact, window};
use render::stages::isolines::params::Isoline;
use render::stages::layout::{
    ASIDE, Axis, BEYOND_BIT, COVERED, Col, Entry, GROUP, GroundAxis, KERNEL_BALL, KERNEL_CLOUD,
    KERNEL_DOT, KERNEL_RIMMED, LEAST_COSINE_SQ, LEAST_SINE, LIGHT_ALONE, LIGHT_GIVEN, LIGHT_OFF,
    LIGHT_OWN, LOOK, MISSING, MOST_EXPONENT, MOST_HOT_PARTS, MOST_PART_ENTRIES, MOST_POWER,
    NO_LIST, Particle, RADIUS_BITS, Row, SCREEN_TILE_PX, SCREEN_TILE_SHIFT, SLOPE_ONE, SQUARE,
    SUBPIXELS, Splat, VIEW_GLOBE, VIEW_TILE, Velocity, WATER_BLUE, WATER_GREEN, WATER_RED,
};
use render::stages::params::{Fields, Params};
use render::stages::{bin, compose, eye, flow, interpolate, isolines, light, map};

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
    let (u32, i32, f32) = (naga::Scalar::U32, naga::Scalar::I32, naga::Scalar::F32);
    let vector = |size, scalar| naga::TypeInner::Vector { size, scalar };
    let inner = |kind: &str| match kind {
        "u32" => naga::TypeInner::Scalar(u32),
        "i32" => naga::TypeInner::Scalar(i32),
        "f32" => naga::TypeInner::Scalar(f32),
        "UVec2" => vector(naga::VectorSize::Bi, u32),
        "IVec2" => vector(naga::VectorSize::Bi, i32),
        "Vec2" => vector(naga::VectorSize::Bi, f32),
        "Vec3" => vector(naga::VectorSize::Tri, f32),
        other => panic!("{other} in {name}"),
    };
    let same = |member: &naga::StructMember, (name, offset, kind): &(&str, usize, &str)| {
        member.name.as_deref() == Some(name)
            && member.offset as usize == *offset
            && module.types[member.ty].inner == inner(kind)
    };
    let wrong = members
        .iter()
        .zip(fields)
        .find(|(member, field)| !same(member, field));
    if let Some((member, field)) = wrong {
        return Some(format!("{name}: {member:?} against {field:?}"));
    }
    // Vectors of three align to four.
    let align = if fields.iter().any(|(_, _, kind)| *kind == "Vec3") {
        16
    } else {
        4
    };
    let complete = members.len() == fields.len() && *span as usize == size.next_multiple_of(align);
    (!complete).then(|| {
        format!(
            "{name}: {} fields, {span} bytes against {}, {size}",
            members.len(),
            fields.len()
        )
    })
}

/// The shaders of pictures.
const SOURCES: [&str; 11] = [
    isolines::SOURCE,
    interpolate::SOURCE,
    splat::SOURCE,
    flow::SOURCE,
    trails::SOURCE,
    light::SOURCE,
    bin::SOURCE,
    scatter::SOURCE,
    eye::SOURCE,
    map::SOURCE,
    compose::SOURCE,
];
/// Those of gap filling.
const FILLS: [&str; 3] = [fill::STENCIL_SOURCE, window::SOURCE, exact::SOURCE];

const TABLES: [(&str, Fields, usize); 8] = [
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
    for (name, fields, size) in TABLES {
        assert_eq!(difference(eye::SOURCE, name, fields, size), None);
    }
    let size = size_of::<Isoline>();
    let found = difference(isolines::SOURCE, "Isoline", Isoline::FIELDS, size);
    assert_eq!(found, None);
    for source in FILLS {
        let size = size_of::<FillLevel>();
        assert_eq!(
            difference(source, "FillLevel", FillLevel::FIELDS, size),
            None
        );
    }
}

/// The structs of parameters that a shader declares, each with what differs from the picture's, if anything does.
fn params(source: &str) -> Vec<(String, Option<String>)> {
    let module = module(source);
    let uniforms = module.global_variables.iter().map(|(_, global)| global);
    let uniforms = uniforms.filter(|global| global.space == naga::AddressSpace::Uniform);
    let compared = uniforms.map(|global| {
        let name = global.name.clone().unwrap();
        let mut known = (FIRST_UNIFORM..).zip(Params::STRUCTS);
        let Some((binding, (_, kind, fields, size))) = known.find(|(_, known)| known.0 == name)
        else {
            return (name, Some("not known".to_owned()));
        };
        let place = global.binding.as_ref().map(|at| (at.group, at.binding));
        let is_there = place == Some((0, binding));
        let is_of_kind = module.types[global.ty].name.as_deref() == Some(kind);
        let difference = if is_there && is_of_kind {
            difference(source, kind, fields, *size)
        } else {
            Some(format!("{place:?} is not {kind} at {binding}"))
        };
        (name, difference)
    });
    compared.collect()
}

#[test]
fn parameters_have_the_same_fields_and_bindings_in_rust_and_wgsl() {
    let compared: Vec<_> = SOURCES.into_iter().flat_map(params).collect();
    for (name, difference) in &compared {
        assert_eq!(*difference, None, "{name}");
    }
    let names: BTreeSet<_> = compared.into_iter().map(|(name, _)| name).collect();
    assert_eq!(names.len(), Params::STRUCTS.len(), "{names:?}");
}

#[test]
fn a_swapped_missing_or_misplaced_field_is_seen() {
    for (right, wrong) in [
        ("rows: u32, cols: u32", "cols: u32, rows: u32"),
        ("rows: u32, ", ""),
        ("rows: u32", "rows: f32"),
        (
            "eye: vec3<f32>, focal_px: f32",
            "focal_px: f32, eye: vec3<f32>",
        ),
        ("center_px: vec2<f32>", "center_px: vec2<i32>"),
        (
            "@binding(17) var<uniform> grid",
            "@binding(18) var<uniform> grid",
        ),
        (
            "var<uniform> values: ValueParams",
            "var<uniform> values: GridParams",
        ),
    ] {
        // A shader that does not read the field.
        let source = light::SOURCE.replacen(right, wrong, 1);
        assert_ne!(source, light::SOURCE);
        let mut compared = params(&source).into_iter();
        assert!(
            compared.any(|(_, difference)| difference.is_some()),
            "{wrong}"
        );
    }
}

/// What the twins and the shader of clouds that look their light up share.
const OF_LOOKS: [(&str, f32); 6] = [
    ("LOOK", LOOK),
    ("ASIDE", ASIDE),
    ("LEAST_SINE", LEAST_SINE),
    ("LEAST_COSINE_SQ", LEAST_COSINE_SQ),
    ("MOST_POWER", MOST_POWER),
    ("MOST_EXPONENT", MOST_EXPONENT),
];

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
        ("BEYOND_BIT", f64::from(BEYOND_BIT)),
        ("RADIUS_BITS", f64::from(RADIUS_BITS)),
        ("MOST_PART_ENTRIES", f64::from(MOST_PART_ENTRIES)),
        ("MOST_HOT_PARTS", f64::from(MOST_HOT_PARTS)),
        ("NO_LIST", f64::from(NO_LIST)),
        ("COVERED", f64::from(COVERED)),
        ("SLOPE_ONE", f64::from(SLOPE_ONE)),
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
        ("KERNEL_RIMMED", f64::from(KERNEL_RIMMED)),
    ] {
        assert!(
            (wgsl(name) - value).abs() <= value.abs() * 1e-7,
            "{name}: {} against {value}",
            wgsl(name)
        );
    }
    for (name, bit) in features::NAMES {
        assert!((wgsl(name) - f64::from(*bit)).abs() < 0.5, "{name}");
        let asks = |source: &&str| source.contains(&format!("feature({name}, "));
        assert!(SOURCES.iter().any(asks), "no shader asks for {name}");
    }
    assert!((wgsl("ASKED") - f64::from(Features::ASKED.bits())).abs() < 0.5);
    for (name, value) in OF_LOOKS {
        let own = constant(scatter::SOURCE, name);
        assert!((own - f64::from(value)).abs() < 1e-7, "{name}");
    }
    let width = constant(fill::STENCIL_SOURCE, "WIDTH");
    let segment = constant(fill::STENCIL_SOURCE, "SEGMENT");
    assert_eq!(segment as u32, width as u32 + 2 * MOST_REACH_COLS);
    assert_eq!(SCREEN_TILE_PX as i32 * SUBPIXELS, 1 << SCREEN_TILE_SHIFT);
}

#[test]
fn every_shader_is_valid_without_extensions() {
    for source in SOURCES.into_iter().chain(FILLS) {
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        let module = module(source);
        validator.validate(&module).unwrap();
        assert!(!module.entry_points.is_empty());
    }
}
