//! What a study was measured with.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::converge::clock::{cores, load_average};

/// The machine and the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Version of the program.
    pub version: String,
    /// The commit that it was built from; empty where it was not built in a repository.
    pub revision: String,
    /// Compiled with optimisation and without overflow checks.
    pub is_release: bool,
    /// The processor's name.
    pub cpu: String,
    /// Threads that it runs at once.
    pub threads: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Load of the minute before the start: above a few tenths, wall-clock seconds are unreliable.
    pub load: String,
    /// When the study began, seconds since 1970.
    pub started: u64,
}

impl Environment {
    /// Of this program on this machine, now.
    pub fn here() -> Environment {
        let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        Environment {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            revision: option_env!("NEUBRDF_REVISION").unwrap_or_default().to_owned(),
            is_release: !cfg!(debug_assertions),
            cpu: name.map_or("unknown".into(), |(_, name)| name.to_owned()),
            threads: cores(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            load: load_average(),
            started: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs()),
        }
    }

    /// The start as `2026-11-24 15:04 UTC`, by the proleptic Gregorian calendar (Hinnant, *chrono-compatible low-level date
    /// algorithms*, 2014).
    pub fn date(&self) -> String {
        let (days, seconds) = (self.started / 86_400 + 719_468, self.started % 86_400);
        let (era, day_of_era) = (days / 146_097, days % 146_097);
        let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let shifted_month = (5 * day_of_year + 2) / 153;
        let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
        let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
        let year = year_of_era + era * 400 + u64::from(month <= 2);
        format!("{year}-{month:02}-{day:02} {:02}:{:02} UTC", seconds / 3600, seconds / 60 % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (started, date) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_399, "2000-02-28 23:59 UTC"),
            (1_709_208_000, "2024-02-29 12:00 UTC"),
        ] {
            assert_eq!(Environment { started, ..Environment::here() }.date(), date);
        }
    }
}
