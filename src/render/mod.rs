//! render

mod material_record;

pub use material_record::{Family, MaterialRecord, MaterialTable, family};
