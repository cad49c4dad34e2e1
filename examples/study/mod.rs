//! What the studies of training share: ground truths, and fits that are not done twice.

#[allow(dead_code)] // a study need not use all
mod fit;
#[allow(dead_code)]
mod truths;

#[allow(unused_imports)] // a study need not name all
pub use fit::{Cost, Errors, bar, errors, kept, key, train};
#[allow(unused_imports)]
pub use truths::{Truth, ours, published};
