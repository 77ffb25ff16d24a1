//! Kinds of stored objects, a folder each, and what the name of one says of its content.

use crate::digest::Digest;
use crate::key::ObjectKey;

/// What an object is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// An input file as it came.
    Raw,
    /// One time step, map-major.
    Field,
    /// Steps and time that each sum of accumulated carbon holds, map-major.
    Contributed,
    /// A run of steps, time-major, as programs of before stored it beside cubes: nobody reads it.
    Series,
    /// The cells that hold data in some step.
    Domain,
    /// What a product consists of.
    Manifest,
    /// Steps of manifests, where there are many.
    ManifestPage,
    /// The newest number of a product's manifests, as a hint: it changes.
    Newest,
    /// A version that is kept until somebody releases it.
    Pin,
    /// A region's share of every cell.
    Weights,
    /// Sums over a region, of every step of a version.
    Sums,
    /// A part of the cube of a product: an Icechunk repository in a folder of the product's name.
    Cube,
    /// Exact sums that accumulation has come to.
    Accumulating,
    /// Measurements of one dataset and month.
    Observations,
    /// Which file holds which month of a dataset.
    ObservationIndex,
    /// What a file of observations held, and what of it is none.
    ObservationFile,
    /// What a file was read as.
    Reading,
    /// Which notice landed a file.
    Landing,
    /// A comparison with published values.
    Check,
    /// A drawn picture.
    Tile,
    /// What all processes over a store agree on.
    Protocol,
}

/// What the name of an object vouches for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vouched {
    /// Its bytes have this digest.
    Bytes(Digest),
    /// Its values have this digest, whatever bytes hold them.
    Values(Digest),
    /// Its name says where it belongs, or what it was made from, and nothing of its content.
    Nothing,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 21] = [
        Self::Raw,
        Self::Field,
        Self::Contributed,
        Self::Series,
        Self::Domain,
        Self::Manifest,
        Self::ManifestPage,
        Self::Newest,
        Self::Pin,
        Self::Weights,
        Self::Sums,
        Self::Cube,
        Self::Accumulating,
        Self::Observations,
        Self::ObservationIndex,
        Self::ObservationFile,
        Self::Reading,
        Self::Landing,
        Self::Check,
        Self::Tile,
        Self::Protocol,
    ];

    /// The top-level folder of such objects, and their name in metrics.
    pub const fn folder(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Field => "frames",
            Self::Contributed => "contributed",
            Self::Series => "series",
            Self::Domain => "domain",
            Self::Manifest => "manifests",
            Self::ManifestPage => "manifest-pages",
            Self::Newest => "newest",
            Self::Pin => "pins",
            Self::Weights => "weights",
            Self::Sums => "sums",
            Self::Cube => "cubes",
            Self::Accumulating => "accumulating",
            Self::Observations => "observations",
            Self::ObservationIndex => "observation-indexes",
            Self::ObservationFile => "observation-files",
            Self::Reading => "readings",
            Self::Landing => "landings",
            Self::Check => "checks",
            Self::Tile => "tiles",
            Self::Protocol => "protocol",
        }
    }

    /// The kind of a key's object; none for one that no part of Fluxglobe stores.
    pub fn of(key: &ObjectKey) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| key.is_in(kind.folder()))
    }
}

impl ObjectKey {
    /// What its name vouches for.
    pub fn vouches(&self) -> Vouched {
        let name = self.as_str().rsplit('/').next().unwrap_or_default();
        let stem = name.strip_suffix(".parquet").unwrap_or(name);
        let digest = |text: &str| text.parse::<Digest>().ok();
        match Kind::of(self) {
            Some(Kind::Field | Kind::Series) => match stem.strip_prefix(Self::OF_VALUES) {
                Some(values) => digest(values).map_or(Vouched::Nothing, Vouched::Values),
                None => digest(stem).map_or(Vouched::Nothing, Vouched::Bytes),
            },
            Some(Kind::Contributed) => digest(stem).map_or(Vouched::Nothing, Vouched::Values),
            Some(Kind::Raw | Kind::Domain | Kind::Observations) => {
                digest(stem).map_or(Vouched::Nothing, Vouched::Bytes)
            }
            _ => Vouched::Nothing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A new kind has no arm here; it must be in the list of all, too.
    fn next(kind: Kind) -> Option<Kind> {
        match kind {
            Kind::Raw => Some(Kind::Field),
            Kind::Field => Some(Kind::Contributed),
            Kind::Contributed => Some(Kind::Series),
            Kind::Series => Some(Kind::Domain),
            Kind::Domain => Some(Kind::Manifest),
            Kind::Manifest => Some(Kind::ManifestPage),
            Kind::ManifestPage => Some(Kind::Newest),
            Kind::Newest => Some(Kind::Pin),
            Kind::Pin => Some(Kind::Weights),
            Kind::Weights => Some(Kind::Sums),
            Kind::Sums => Some(Kind::Cube),
            Kind::Cube => Some(Kind::Accumulating),
            Kind::Accumulating => Some(Kind::Observations),
            Kind::Observations => Some(Kind::ObservationIndex),
            Kind::ObservationIndex => Some(Kind::ObservationFile),
            Kind::ObservationFile => Some(Kind::Reading),
            Kind::Reading => Some(Kind::Landing),
            Kind::Landing => Some(Kind::Check),
            Kind::Check => Some(Kind::Tile),
            Kind::Tile => Some(Kind::Protocol),
            Kind::Protocol => None,
        }
    }

    #[test]
    fn every_kind_is_listed_and_has_a_folder_of_its_own() {
        let all = std::iter::successors(Some(Kind::Raw), |kind| next(*kind));
        assert_eq!(all.collect::<Vec<_>>(), Kind::ALL);
        let folders = Kind::ALL.map(Kind::folder);
        let distinct: std::collections::BTreeSet<&str> = folders.into();
        assert_eq!(distinct.len(), Kind::ALL.len());
    }

    #[test]
    fn every_key_is_of_its_kind_and_vouches_for_what_it_names() {
        let (product, digest) = ("p".parse().unwrap(), Digest::of(b"x"));
        let (bytes, values) = (Vouched::Bytes(digest), Vouched::Values(digest));
        let old_field: ObjectKey = format!("frames/p/{digest}.parquet").parse().unwrap();
        for (key, kind, vouched) in [
            (ObjectKey::raw(&product, &digest), Kind::Raw, bytes),
            (ObjectKey::field(&product, &digest), Kind::Field, values),
            (old_field, Kind::Field, bytes),
            (ObjectKey::series(&product, &digest), Kind::Series, values),
            (
                ObjectKey::contributed(&product, &digest),
                Kind::Contributed,
                values,
            ),
            (ObjectKey::domain(&product, &digest), Kind::Domain, bytes),
            (
                ObjectKey::observations(&product, &digest),
                Kind::Observations,
                bytes,
            ),
            (
                ObjectKey::manifest(&product, 7),
                Kind::Manifest,
                Vouched::Nothing,
            ),
            (
                ObjectKey::manifest_page(&product, &digest),
                Kind::ManifestPage,
                Vouched::Nothing,
            ),
            (ObjectKey::newest(&product), Kind::Newest, Vouched::Nothing),
            (ObjectKey::pin(&product, 7), Kind::Pin, Vouched::Nothing),
            (ObjectKey::weights(&digest), Kind::Weights, Vouched::Nothing),
            (ObjectKey::check(&digest), Kind::Check, Vouched::Nothing),
            (ObjectKey::tile(&digest), Kind::Tile, Vouched::Nothing),
        ] {
            assert_eq!((Kind::of(&key), key.vouches()), (Some(kind), vouched));
        }
        let other: ObjectKey = format!("elsewhere/{digest}").parse().unwrap();
        assert_eq!(
            (Kind::of(&other), other.vouches()),
            (None, Vouched::Nothing)
        );
    }

    #[test]
    fn a_name_that_is_no_digest_vouches_for_nothing() {
        for name in ["frames/p/a.parquet", "frames/p/v2-a.parquet", "raw/p/b"] {
            let key: ObjectKey = name.parse().unwrap();
            assert_eq!(key.vouches(), Vouched::Nothing);
        }
    }
}
