//! The command line: one file a subcommand. Each parses, calls the library and prints.

#[macro_use]
mod tell;

mod brdf_input;
mod compare;
mod converge;
mod export;
mod info;
mod job;
mod judge;
mod material;
mod progress;
#[cfg(feature = "embree")]
mod reference;
mod render;
mod train;
mod train_group;
mod train_loop;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// What a shell is told.
const EXIT_STATUSES: &str = "\
Exit status:
  0    done
  1    an error, which standard error tells
  2    wrong usage
  3    done, but a threshold or a check does not hold: compare, converge, material
  130  interrupted (Ctrl-C, SIGTERM, SIGHUP): what there was is written";

/// A Vulkan path tracer for OBJ scenes whose radiance is proved against an Embree CPU reference.
#[derive(Parser)]
#[command(version, max_term_width = 110, after_help = EXIT_STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Path trace a scene on a Vulkan device.
    Render(Box<render::Arguments>),
    /// Path trace a scene on the CPU with Embree: slow, independent, the picture to compare with.
    #[cfg(feature = "embree")]
    Reference(Box<reference::Arguments>),
    /// Say how two pictures differ: MSE, relMSE, FLIP, bias, and a z-test where they carry variances.
    Compare(compare::Arguments),
    /// Learn a BRDF: from measurements, a network or a closed form to a small neural material.
    Train(Box<train::Arguments>),
    /// Say what a BRDF is; draw and check it.
    Material(material::Arguments),
    /// Measure how error falls with time, method by method, and test for bias.
    Converge(Box<converge::Arguments>),
    /// Write NeuBRDFs as shader modules for other tracers, or a scene as Mitsuba 3 reads it.
    Export(export::Arguments),
    /// List the Vulkan devices, what each would be used for, and what an unfit one lacks.
    Info(info::Arguments),
}

/// Parses, runs, and turns an error into a message on standard error and exit status 1.
pub fn main() -> ExitCode {
    progress::keep_hangups_ignored();
    let result = match Arguments::parse().command {
        Command::Render(arguments) => render::run(*arguments),
        #[cfg(feature = "embree")]
        Command::Reference(arguments) => reference::run(*arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Train(arguments) => train::run(*arguments),
        Command::Material(arguments) => material::run(arguments),
        Command::Converge(arguments) => converge::run_command(*arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Info(arguments) => info::run(arguments),
    };
    match result {
        // Though all may have been done by then: whoever asks for an end wants nothing to come after it.
        Ok(_) if progress::is_interrupted() => ExitCode::from(progress::INTERRUPTED_STATUS),
        Ok(status) => status,
        Err(error) => {
            note!("error: {}", message(&error));
            ExitCode::FAILURE
        }
    }
}

/// An error and its causes, those left out that the text so far already tells.
fn message(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |message, cause| match message.as_str() {
        "" => cause,
        told if told.contains(&cause) => message,
        _ => format!("{message}: {cause}"),
    })
}
