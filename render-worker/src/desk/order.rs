//! How a picture is wanted.

use contract::encoding::Encoding;

use render::plan::Part;

use super::Class;

/// Who wants a picture, and what the store has to do with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order {
    /// Who wants it.
    pub class: Class,
    /// What the store has to do with it.
    pub storing: Storing,
    /// As which bytes it travels. In another than the stored one the store has nothing to do with it.
    pub encoding: Encoding,
    /// The part of it that is wanted, without annotations; all of it with None. The store has nothing to do with a part.
    pub part: Option<Part>,
}

/// What the store has to do with a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Storing {
    /// It is looked for there, and kept there once it is drawn.
    LookUpAndKeep,
    /// Whoever orders it has looked, and it was not there: it is kept there.
    Keep,
    /// Nothing: it is drawn and given out.
    Nothing,
}

impl Order {
    /// For somebody who waits.
    pub fn on_demand(storing: Storing) -> Self {
        Self {
            class: Class::OnDemand,
            storing,
            encoding: Encoding::Png,
            part: None,
        }
    }

    /// A part of the picture, or all of it with None.
    #[must_use]
    pub fn of_part(self, part: Option<Part>) -> Self {
        let storing = match part {
            None => self.storing,
            Some(_) => Storing::Nothing,
        };
        Self {
            storing,
            part,
            ..self
        }
    }

    /// The same as other bytes.
    #[must_use]
    pub fn encoded(self, encoding: Encoding) -> Self {
        let storing = if encoding.is_stored() {
            self.storing
        } else {
            Storing::Nothing
        };
        Self {
            storing,
            encoding,
            ..self
        }
    }

    /// For later; looked for and kept, for nobody waits for its bytes.
    pub fn batch() -> Self {
        Self {
            class: Class::Batch,
            storing: Storing::LookUpAndKeep,
            encoding: Encoding::Png,
            part: None,
        }
    }
}
