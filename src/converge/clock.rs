//! Times, and how busy the rest of the machine was meanwhile (elsewhere than on Linux processor times are 0).

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::gpu::Profile;

/// Ticks of /proc/stat a second (USER_HZ, which is 100 on every Linux).
const TICKS: f64 = 100.0;

/// How long a GPU is kept busy before something is timed.
const WARM_UP: Duration = Duration::from_millis(500);

/// What something took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Wall-clock time.
    pub seconds: f64,
    /// Processor time of the processes that did it, all their threads.
    pub cpu_seconds: f64,
    /// Cores that other processes kept busy, on average.
    pub others: f64,
}

/// Runs from its making.
pub struct Stopwatch {
    started: Instant,
    processes: Vec<u32>,
    busy: f64,
    own: f64,
}

impl Stopwatch {
    /// Times work that this process does.
    pub fn own() -> Stopwatch {
        Stopwatch::of(vec![std::process::id()])
    }

    /// Times work that these processes do.
    pub fn of(processes: Vec<u32>) -> Stopwatch {
        let (busy, own) = (busy_seconds(), cpu_seconds(&processes));
        Stopwatch { started: Instant::now(), processes, busy, own }
    }

    /// What it took so far.
    pub fn stop(&self) -> Timing {
        let seconds = self.started.elapsed().as_secs_f64();
        let cpu_seconds = cpu_seconds(&self.processes) - self.own;
        let others = ((busy_seconds() - self.busy - cpu_seconds) / seconds.max(1e-9)).max(0.0);
        Timing { seconds, cpu_seconds, others }
    }
}

/// Does work over and over until a GPU runs at the pace that it keeps. After a second or two without work it lowers its clocks (an H100's from 1980
/// to 345 MHz), and it takes some 0.3 s of work to raise them: what is timed too early looks up to five times as slow.
///
/// # Errors
/// The work's.
pub fn warm_up<E>(profile: &Profile, mut work: impl FnMut() -> Result<(), E>) -> Result<(), E> {
    let started = Instant::now();
    while !profile.is_cpu && started.elapsed() < WARM_UP {
        work()?;
    }
    Ok(())
}

/// Seconds that all cores together were busy since the machine started.
fn busy_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let fields = stat.lines().next().unwrap_or_default().split_whitespace().skip(1);
    let ticks: Vec<f64> = fields.filter_map(|field| field.parse().ok()).collect();
    // user, nice, system, (idle, iowait,) irq, softirq, steal
    [0, 1, 2, 5, 6, 7].iter().filter_map(|field| ticks.get(*field)).sum::<f64>() / TICKS
}

/// Processor time of these processes. By their clocks, which count nanoseconds: what /proc says of a process is in ticks.
fn cpu_seconds(processes: &[u32]) -> f64 {
    processes.iter().map(|process| process_seconds(*process)).sum()
}

#[cfg(target_os = "linux")]
fn process_seconds(process: u32) -> f64 {
    use nix::time::{clock_getcpuclockid, clock_gettime};
    let time = clock_getcpuclockid(nix::unistd::Pid::from_raw(process as i32)).and_then(clock_gettime);
    time.map_or(0.0, |time| Duration::from(time).as_secs_f64())
}

#[cfg(not(target_os = "linux"))]
fn process_seconds(_: u32) -> f64 {
    0.0
}

/// The load of the last minute.
pub fn load_average() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    load.split_whitespace().next().unwrap_or("?").to_owned()
}

/// Threads that the machine runs at once.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
