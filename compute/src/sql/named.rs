//! Names of tables that are products: which product, and which of its versions.

use contract::manifest::{AskedVersion, Manifest};
use contract::product::ProductId;
use contract::region::MaskCode;
use storage::manifests;

use crate::{ComputeError, Engine};

/// A product, and perhaps one of its versions.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Named {
    pub(super) product: ProductId,
    number: Option<u64>,
    /// The digest that the version must have.
    digest: Option<String>,
}

impl Named {
    /// `name`, `name@12` or `name@12-0a1b2c3d`; `_` stands for `-` in the name, so that it needs no quotes.
    pub(super) fn of(text: &str) -> Option<Self> {
        let text = match text.split_once('@') {
            Some((product, version)) => format!("{}@{version}", product.replace('_', "-")),
            None => text.replace('_', "-"),
        };
        let AskedVersion {
            product,
            number,
            digest,
        } = text.parse().ok()?;
        Some(Self {
            product,
            number,
            digest,
        })
    }

    /// The newest version of a product.
    pub(super) fn newest(product: ProductId) -> Self {
        Self {
            product,
            number: None,
            digest: None,
        }
    }

    /// A mask and a code or what it means, `name:3`, the name as of [`Self::of`]: the cells where that mask has this code.
    pub(super) fn with_code(text: &str) -> Option<(Self, MaskCode)> {
        let (mask, code) = MaskCode::split(text)?;
        Some((Self::of(mask)?, code))
    }

    /// # Errors
    /// There is the product, and not the version of it.
    pub(super) async fn check_version(&self, engine: &Engine) -> Result<(), ComputeError> {
        let version = match (self.number, &self.digest) {
            (Some(number), Some(digest)) => format!("{number}-{digest}"),
            (Some(number), None) => number.to_string(),
            (None, _) => return Ok(()),
        };
        let Some(newest) = manifests::latest(engine.store(), &self.product).await? else {
            return Ok(());
        };
        let newest = match &self.digest {
            Some(_) => newest.id().to_string(),
            None => newest.number.to_string(),
        };
        Err(ComputeError::Sql {
            reason: format!(
                "{} has no version {version}; the newest is {newest}",
                self.product
            ),
        })
    }

    /// The version that is there now.
    pub(super) async fn manifest(&self, engine: &Engine) -> Result<Option<Manifest>, ComputeError> {
        let store = engine.store();
        let manifest = match self.number {
            Some(number) => manifests::numbered(store, &self.product, number).await?,
            None => manifests::latest(store, &self.product).await?,
        };
        let is_it = |manifest: &Manifest| match &self.digest {
            Some(digest) => manifest.id().to_string().ends_with(&format!("-{digest}")),
            None => true,
        };
        Ok(manifest.filter(is_it))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_needs_no_quotes_and_may_say_a_version() {
        let of = |text: &str| {
            let named = Named::of(text)?;
            Some((named.product.to_string(), named.number, named.digest))
        };
        let p = "a-b".to_owned();
        assert_eq!(of("a-b"), Some((p.clone(), None, None)));
        assert_eq!(of("a_b"), Some((p.clone(), None, None)));
        assert_eq!(of("a-b@12"), Some((p.clone(), Some(12), None)));
        let digest = Some("0a1b2c3d".to_owned());
        assert_eq!(of("a-b@12-0a1b2c3d"), Some((p, Some(12), digest)));
        for wrong in ["a-b@", "a-b@x", "a-b@012", "a-b@+1", "../a", "A", ""] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_code_follows_the_name_of_a_mask() {
        let of = |text: &str| {
            let (named, code) = Named::with_code(text)?;
            Some((named.product.to_string(), named.number, code.to_string()))
        };
        let p = "a-b".to_owned();
        assert_eq!(of("a_b:3"), Some((p.clone(), None, "3".to_owned())));
        assert_eq!(
            of("a-b@2:-1.5"),
            Some((p.clone(), Some(2), "-1.5".to_owned()))
        );
        assert_eq!(of("a_b:x_y"), Some((p, None, "x_y".to_owned())));
        for wrong in [
            "a-b",
            "a-b:",
            "a-b:x y",
            "a-b:nan",
            "A:1",
            "{\"a\":1}",
            "a-b@x:1",
        ] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }
}
