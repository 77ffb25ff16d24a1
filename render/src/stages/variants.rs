//! An entry point in the variants that pictures want, each compiled when it is first wanted.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::gpu::{Gpu, Kernel};
use crate::stages::features::Features;

/// Variants of an entry point that are kept. Users choose what is drawn: further ones ask their parameters, as graphics
/// cards do.
const MOST_VARIANTS: usize = 64;

/// Values of override constants.
type Constants = Vec<(&'static str, u32)>;

/// An entry point and what has been compiled of it.
pub struct Variants {
    label: &'static str,
    source: String,
    entry: &'static str,
    uniforms: Vec<u32>,
    compiled: Mutex<HashMap<Constants, Arc<OnceLock<Kernel>>>>,
}

/// A compiled variant.
pub struct Variant(Arc<OnceLock<Kernel>>);

impl std::ops::Deref for Variant {
    type Target = Kernel;

    fn deref(&self) -> &Kernel {
        self.0.get().expect("compiled before it was given")
    }
}

impl Variants {
    /// None compiled yet; all read these structs of parameters.
    pub fn new<U: Copy + Into<u32>>(
        label: &'static str,
        source: &str,
        entry: &'static str,
        uniforms: &[U],
    ) -> Self {
        Self {
            label,
            source: source.to_owned(),
            entry,
            uniforms: uniforms.iter().map(|&number| number.into()).collect(),
            compiled: Mutex::default(),
        }
    }

    /// Compiles at once what needs no features of a picture, so that none waits for it.
    #[must_use]
    pub fn compiled(self, gpu: &Gpu, constants: &[(&'static str, u32)]) -> Self {
        if !gpu.runs_both_sides() {
            self.of(gpu, constants, Features::ASKED);
        }
        self
    }

    /// The variant with values of override constants for pictures with these features.
    pub fn of(&self, gpu: &Gpu, constants: &[(&'static str, u32)], features: Features) -> Variant {
        let decided = if gpu.runs_both_sides() {
            features.asked_by(&self.source)
        } else {
            Features::ASKED
        };
        let place = self.place(constants, decided);
        place.1.get_or_init(|| {
            let constants: Vec<_> = place
                .0
                .iter()
                .map(|&(name, value)| (name, f64::from(value)))
                .collect();
            gpu.variant(self.label, &self.source, self.entry, &constants)
                .reading(&self.uniforms)
        });
        Variant(place.1)
    }

    fn place(
        &self,
        constants: &[(&'static str, u32)],
        features: Features,
    ) -> (Constants, Arc<OnceLock<Kernel>>) {
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        let with = |features: Features| [constants, &[("FEATURES", features.bits())]].concat();
        let mut key = with(features);
        if compiled.len() >= MOST_VARIANTS && !compiled.contains_key(&key) {
            key = with(Features::ASKED);
        }
        let place = Arc::clone(compiled.entry(key.clone()).or_default());
        (key, place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::params::{Params, Uniform};

    #[test]
    fn what_users_ask_for_fills_no_memory_with_variants() {
        let variants = Variants::new::<Uniform>("a", "", "b", &[]);
        let features = |kind: u32| Features::of(&Params::default()).with(kind);
        let key = |kind: u32| variants.place(&[("KERNEL", 1)], features(kind)).0;
        for kind in 0..MOST_VARIANTS as u32 {
            assert_eq!(
                key(kind),
                [("KERNEL", 1), ("FEATURES", features(kind).bits())]
            );
        }
        let asked = [("KERNEL", 1), ("FEATURES", Features::ASKED.bits())];
        assert_eq!(key(1000), asked, "a further one is compiled");
        assert_eq!(key(1001), asked);
        assert_eq!(
            key(3),
            [("KERNEL", 1), ("FEATURES", features(3).bits())],
            "one that was there is lost"
        );
    }
}
