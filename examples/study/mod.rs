//! What the studies of training share: ground truths, and fits that are not done twice.

#![allow(dead_code, unused_imports)] // a study need not use all

mod fit;
mod truths;

pub use fit::{Cost, Errors, Trained, bar, errors, errors_of, kept, key, train};
pub use truths::{Truth, all, ours, published};
