//! The program as the judge of its own volume: a scene that nothing was fitted to, held to the bounds that are published.

use harness::program;

/// A coast seen aslant, at the bounds of docs/performance-quality.md.
const WORDS: &str =
    "--cpu bench quality --scenes held-out --only coast --least-psnr 40 --most-flip 0.03";

fn words(more: &'static str) -> Vec<&'static str> {
    WORDS.split(' ').chain(more.split(' ')).collect()
}

#[test]
fn a_scene_that_nothing_was_fitted_to_is_as_near_to_the_reference_as_we_say() {
    let data = tempfile::tempdir().unwrap();
    program::succeed(data.path(), &words("--slices 128")).unwrap();
    // Sixteen slices are too few for it.
    let told = program::fail(data.path(), &words("--slices 16 --size 64")).unwrap();
    assert!(told.contains("southern coast"), "{told}");
    assert!(told.contains("16 slices: "), "{told}");
}
