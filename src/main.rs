//! The `neubrdf` command.

fn main() {}
