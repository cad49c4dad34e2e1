//! Times, and how busy the rest of the machine was meanwhile (by /proc: elsewhere than on Linux processor times are 0).

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::gpu::Profile;

/// Ticks of /proc a second (USER_HZ, which is 100 on every Linux).
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

fn cpu_seconds(processes: &[u32]) -> f64 {
    processes
        .iter()
        .map(|process| {
            let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
            // After the name, which may hold blanks: fields 14 and 15 are user and system time.
            let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace();
            fields.skip(11).take(2).filter_map(|field| field.parse::<f64>().ok()).sum::<f64>() / TICKS
        })
        .sum()
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
