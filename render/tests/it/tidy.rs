//! Rules of the house: every stage has its three files, and the two frames list the same stages in the same order.

use std::path::Path;

const SOURCES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src");

#[test]
fn every_stage_and_every_form_of_filling_has_a_shader_and_a_twin() {
    assert_eq!(check("stages"), 11);
    assert_eq!(check("stages/fill"), 2);
}

/// The number of folders within a folder, each with its three files.
fn check(folder: &str) -> usize {
    let mut stages = 0;
    for entry in std::fs::read_dir(Path::new(SOURCES).join(folder)).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            let name = path.file_name().unwrap().to_str().unwrap();
            for file in [
                "mod.rs".to_owned(),
                "cpu.rs".to_owned(),
                format!("{name}.wgsl"),
            ] {
                assert!(path.join(&file).is_file(), "{name} has no {file}");
            }
            stages += 1;
        }
    }
    stages
}

/// Stages in the order in which a text first calls each.
fn order<'a>(text: &str, stages: &[&'a str], call: impl Fn(&str) -> String) -> Vec<&'a str> {
    let mut found: Vec<_> = stages
        .iter()
        .map(|stage| (text.find(&call(stage)).unwrap_or(usize::MAX), *stage))
        .collect();
    found.retain(|(at, _)| *at != usize::MAX);
    found.sort_unstable();
    found.into_iter().map(|(_, stage)| stage).collect()
}

#[test]
fn both_frames_list_the_same_stages_in_the_same_order() {
    let read = |file: &str| std::fs::read_to_string(Path::new(SOURCES).join(file)).unwrap();
    let stages = [
        "interpolate",
        "isolines",
        "map",
        "flow",
        "particles",
        "project",
        "light",
        "bin",
        "eye",
        "compose",
    ];
    let cpu = read("frame_cpu.rs");
    let (_, draw) = cpu.split_once("pub fn draw(").unwrap();
    let (draw, _) = draw.split_once("\n}\n").unwrap();
    // Three stages are called through a function that also makes their buffers.
    let draw = draw
        .replacen("interpolated(", "interpolate::cpu::(", 1)
        .replacen("lined(", "isolines::cpu::(", 1)
        .replacen("binned(", "bin::cpu::(", 1);
    let cpu = order(&draw, &stages, |stage| format!("{stage}::cpu::"));
    assert_eq!(cpu, stages);
    // On the device two passes stand for the stages that see one particle at a time, and the eye composes.
    let passes = [
        "interpolate",
        "isolines",
        "map",
        "compose",
        "flow",
        "trails",
        "splats",
        "light",
        "bin",
        "scatter",
        "eye",
    ];
    let gpu = order(&read("frame.rs"), &passes, |stage| {
        format!("self.{stage}.record(")
    });
    assert_eq!(gpu, passes);
}
