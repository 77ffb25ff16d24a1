//! Topics of the event log and places in them.

use std::fmt::{Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::ContractError;

/// A kind of events that is read on its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Topic {
    /// Files that are there to be ingested.
    #[serde(rename = "granule.notice")]
    GranuleNotice,
    /// Files that are in a product.
    #[serde(rename = "granule.landed")]
    GranuleLanded,
    /// Messages and files that were refused.
    #[serde(rename = "granule.rejected")]
    GranuleRejected,
    /// Measurements of buoys, ships, stations and profiles.
    #[serde(rename = "observation")]
    Observation,
    /// Products computed from others.
    #[serde(rename = "product.derived")]
    ProductDerived,
    /// Pictures that are wanted.
    #[serde(rename = "render.job")]
    RenderJob,
    /// Pictures that are there.
    #[serde(rename = "render.done")]
    RenderDone,
}

impl Topic {
    /// All of them, in the order of the data.
    pub const ALL: [Self; 7] = [
        Self::GranuleNotice,
        Self::Observation,
        Self::GranuleLanded,
        Self::GranuleRejected,
        Self::ProductDerived,
        Self::RenderJob,
        Self::RenderDone,
    ];

    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::GranuleNotice => "granule.notice",
            Self::GranuleLanded => "granule.landed",
            Self::GranuleRejected => "granule.rejected",
            Self::Observation => "observation",
            Self::ProductDerived => "product.derived",
            Self::RenderJob => "render.job",
            Self::RenderDone => "render.done",
        }
    }
}

impl Display for Topic {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

impl std::str::FromStr for Topic {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|topic| topic.as_str() == s);
        let known = || Self::ALL.map(Self::as_str).join(", ");
        found.ok_or_else(|| ContractError::invalid("topic", s, known()))
    }
}

/// The place of one message in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Topic.
    pub topic: Topic,
    /// Partition of the topic, from 0.
    pub partition: u32,
    /// Number of the message in its partition, from 0.
    pub offset: u64,
}

impl Display for Origin {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}", self.topic, self.partition, self.offset)
    }
}

impl std::str::FromStr for Origin {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || ContractError::invalid("origin", s, "TOPIC/PARTITION/OFFSET");
        let mut parts = s.split('/');
        let (Some(topic), Some(partition), Some(offset), None) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(bad());
        };
        Ok(Self {
            topic: topic.parse()?,
            partition: partition.parse().map_err(|_unparsed| bad())?,
            offset: offset.parse().map_err(|_unparsed| bad())?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_written_as_it_is_read() {
        let origin: Origin = "granule.notice/3/17".parse().unwrap();
        assert_eq!(
            (origin.topic, origin.partition, origin.offset),
            (Topic::GranuleNotice, 3, 17)
        );
        assert_eq!(origin.to_string(), "granule.notice/3/17");
        for text in [
            "granule.notice/3",
            "granule.notice/3/17/1",
            "nothing/0/0",
            "render.job/-1/0",
        ] {
            assert!(text.parse::<Origin>().is_err(), "{text}");
        }
    }

    #[test]
    fn json_names_are_the_topics_names() {
        for topic in Topic::ALL {
            assert_eq!(
                serde_json::to_string(&topic).unwrap(),
                format!("\"{topic}\"")
            );
            assert_eq!(topic.as_str().parse::<Topic>().unwrap(), topic);
        }
    }
}
