//! Tests of the renderer as a whole and of its stages, one binary.

mod compare;
mod device;
mod gallery;
mod golden;
mod layout;
mod limits;
mod reference;
mod scenes;
mod seams;
mod service;
mod tidy;
mod truths;
mod twins;
