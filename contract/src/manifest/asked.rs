//! A version of a product as somebody asks for it, by as much of its name as they know.

use std::fmt::{Display, Formatter};

use super::id::version_number;
use super::{Manifest, ManifestId};
use crate::ContractError;
use crate::product::ProductId;

/// A product, and perhaps one of its versions: `NAME`, `NAME@12` or `NAME@12-0a1b2c3d`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AskedVersion {
    /// Product.
    pub product: ProductId,
    /// The number of a version; the newest without one.
    pub number: Option<u64>,
    /// The digest that the version must have, if one was given.
    pub digest: Option<String>,
}

impl AskedVersion {
    /// Is it the version that is asked for?
    pub fn is(&self, manifest: &Manifest, id: &ManifestId) -> bool {
        let has_digest = |digest: &String| id.to_string().ends_with(&format!("-{digest}"));
        self.product == manifest.product
            && self.number.is_none_or(|number| number == manifest.number)
            && self.digest.as_ref().is_none_or(has_digest)
    }
}

impl From<ProductId> for AskedVersion {
    fn from(product: ProductId) -> Self {
        Self {
            product,
            number: None,
            digest: None,
        }
    }
}

impl Display for AskedVersion {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        self.product.fmt(f)?;
        if let Some(number) = self.number {
            write!(f, "@{number}")?;
        }
        if let Some(digest) = &self.digest {
            write!(f, "-{digest}")?;
        }
        Ok(())
    }
}

impl std::str::FromStr for AskedVersion {
    type Err = ContractError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let Some((product, version)) = text.split_once('@') else {
            return text.parse::<ProductId>().map(Self::from);
        };
        let (number, digest) = match version.split_once('-') {
            Some((number, digest)) => (number, Some(digest.to_owned())),
            None => (version, None),
        };
        let is_digest = |text: &String| {
            text.len() == 8 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
        };
        let bad = |advice: Option<String>| {
            let reason = advice.unwrap_or_else(|| "give NAME@12 or NAME@12-0a1b2c3d".to_owned());
            ContractError::invalid("version", text, reason)
        };
        let number = version_number(number).map_err(bad)?;
        if digest.as_ref().is_some_and(|digest| !is_digest(digest)) {
            return Err(bad(None));
        }
        Ok(Self {
            product: product.parse()?,
            number: Some(number),
            digest,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_a_number_with_or_without_its_digest() {
        let parse = |text: &str| text.parse::<AskedVersion>();
        let of = |number, digest: Option<&str>| AskedVersion {
            product: "p".parse().unwrap(),
            number,
            digest: digest.map(str::to_owned),
        };
        for (text, wanted) in [
            ("p", of(None, None)),
            ("p@12", of(Some(12), None)),
            ("p@12-0a1b2c3d", of(Some(12), Some("0a1b2c3d"))),
        ] {
            assert_eq!(parse(text), Ok(wanted.clone()));
            assert_eq!(wanted.to_string(), text);
        }
        for wrong in [
            "P",
            "p@",
            "p@x",
            "@1",
            "p@-1",
            "p@+1",
            "p@1-",
            "p@1-0a1b2c3",
            "p@1-0A1B2C3D",
            "p@1@2",
            "p@18446744073709551616",
        ] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    /// A version has one name: `01` is no second one of 1, in what is asked for as in what is stored.
    #[test]
    fn a_number_with_zeros_before_it_is_refused_with_the_one_to_write() {
        let asked = |text: &str| text.parse::<AskedVersion>().map(drop);
        let named = |text: &str| text.parse::<ManifestId>().map(drop);
        for refused in [
            asked("p@01"),
            asked("p@001-0a1b2c3d"),
            named("p@01-0a1b2c3d"),
        ] {
            let said = refused.unwrap_err().to_string();
            assert!(said.contains("without zeros before it: @1"), "{said}");
        }
        assert!(named("p@+1-0a1b2c3d").is_err());
        assert_eq!((asked("p@10"), named("p@10-0a1b2c3d")), (Ok(()), Ok(())));
    }
}
