//! Files of observations: real ones against the numbers of another reader, and ones made here to be hard.

mod made;
mod real;
