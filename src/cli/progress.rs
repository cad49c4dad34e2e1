//! What a long command shows while it runs: a bar with ETA on a terminal, nothing when it is quiet or piped.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Steps of a bar over something that is not counted.
pub const STEPS: u64 = 1000;

/// A bar over `length` steps; `quiet` gives one that shows nothing.
pub fn bar(length: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    // The template is a constant: were it wrong, the plain bar is still a bar.
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed} + {eta}  {msg}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// Keeps the promise of `nohup`: SIGHUP, which [`interrupt_flag`] listens to, does not reach this thread and those that it will start, if
/// whoever started the program had it ignored.
pub fn keep_hangups_ignored() {
    #[cfg(target_os = "linux")]
    {
        use nix::sys::signal::{SigSet, Signal};
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        if ignored >> (Signal::SIGHUP as u32 - 1) & 1 == 1 {
            // What cannot be blocked ends the render with all that there is.
            let _ = SigSet::from(Signal::SIGHUP).thread_block();
        }
    }
}

/// Whether somebody asked for an end.
static INTERRUPTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Exit status of what was interrupted, as of what Ctrl-C kills: what a shell would do next, it does not.
pub const INTERRUPTED_STATUS: u8 = 130;

/// A flag that the first Ctrl-C raises, or a request to end from elsewhere (SIGTERM, SIGHUP: a batch system, a session that is closed);
/// a second one ends the process at once.
pub fn interrupt_flag() -> anyhow::Result<Arc<AtomicBool>> {
    ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(INTERRUPTED_STATUS.into());
        }
        note!("\nfinishing, so that nothing is lost; press Ctrl-C again to stop at once");
    })?;
    Ok(INTERRUPTED.clone())
}

/// Whether that flag is raised.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
