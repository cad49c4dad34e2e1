//! Studies: how error falls with time, method by method, how sure that is, and whether any method is biased.
//!
//! A [`Plan`] says which scenes are rendered by which [`Method`]s; [`run`] carries it out and returns a [`Record`] of every number;
//! [`Analysis`] makes of it what [`write_report`] writes. docs/convergence.md explains each figure.

mod analysis;
mod csv;
mod engine;
mod environment;
mod error;
mod gate;
mod gram;
mod ground_truth;
mod html;
mod method;
mod plan;
pub mod plot;
mod record;
mod report;
mod run;
mod text;
mod versus;

pub use analysis::{Analysis, MethodResult, Rung, SceneResult};
pub use engine::Preparation;
pub use environment::Environment;
pub use error::Error;
pub use gate::{Gate, Verdict};
pub use gram::Gram;
pub use ground_truth::{AboutTruth, GroundTruth};
pub use method::{AXES, Axes, Engine, Method, UnknownWord};
pub use plan::{Clock, Plan, ScenePlan};
pub use record::{BiasTest, MethodRecord, Products, Question, Record, Run, SceneRecord};
pub use report::write_report;
pub use run::{Event, RECORD_FILE, average, run};
pub use text::{change_lines, summary_text, verdict_lines};
pub use versus::{Change, Versus, compare};
