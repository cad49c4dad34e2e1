//! render

mod material_record;

pub use material_record::{Family, MATERIAL_STRUCTS, MaterialRecord, MaterialTable, family};
