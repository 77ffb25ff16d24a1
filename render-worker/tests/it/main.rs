//! Tests of the renderer as a whole and of its stages, one binary.

mod gallery;
mod scenes;
