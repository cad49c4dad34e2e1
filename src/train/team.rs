//! Threads that take many short steps side by side.
//!
//! A step of training takes a few tenths of a millisecond, and between two of its parts everyone waits for everyone. Threads that go to sleep
//! meanwhile, as those of a pool do, take about as long to wake; these look out for each other.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Looks at the others before a waiting thread lets whoever else wants its core have it: some microseconds.
const LOOKS: u32 = 100;

struct Team {
    size: usize,
    /// Threads that wait.
    waiting: AtomicUsize,
    /// Times that all had come.
    meetings: AtomicUsize,
    is_broken: AtomicBool,
}

/// One of the threads.
pub struct Member<'a> {
    team: &'a Team,
    index: usize,
}

/// Lets `work` run on so many threads, of which this is one, until all have done it.
///
/// # Panics
/// If one of them does: the others stop where they next wait.
pub fn work_together(size: usize, work: impl Fn(&Member) + Sync) {
    let (waiting, meetings) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let team = Team { size: size.max(1), waiting, meetings, is_broken: AtomicBool::new(false) };
    let (team, work) = (&team, &work);
    thread::scope(|scope| {
        // Before the others, who would wait for it if there were no more threads to be had.
        let own = Member { team, index: 0 };
        for index in 1..team.size {
            scope.spawn(move || work(&Member { team, index }));
        }
        work(&own);
    });
}

impl Member<'_> {
    /// Those of `items`, with their places, that are this thread's: the same each time, so that they stay in its caches.
    pub fn own<'i, T>(&self, items: &'i [T]) -> impl Iterator<Item = (usize, &'i T)> + use<'i, T> {
        items.iter().enumerate().skip(self.index).step_by(self.team.size)
    }

    /// Whether what has this place is this thread's.
    pub fn owns(&self, place: usize) -> bool {
        place % self.team.size == self.index
    }

    /// Waits until all threads are here.
    pub fn wait(&self) {
        let Team { size, waiting, meetings, is_broken } = self.team;
        let before = meetings.load(Ordering::Acquire);
        if waiting.fetch_add(1, Ordering::AcqRel) + 1 == *size {
            waiting.store(0, Ordering::Relaxed);
            meetings.fetch_add(1, Ordering::Release);
            return;
        }
        let mut looks = 0;
        while meetings.load(Ordering::Acquire) == before {
            assert!(!is_broken.load(Ordering::Relaxed), "another thread panicked");
            looks += 1;
            if looks < LOOKS { spin_loop() } else { thread::yield_now() }
        }
    }
}

impl Drop for Member<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.team.is_broken.store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn nobody_goes_on_before_all_have_come() {
        for size in [1, 2, 5] {
            let counts: Vec<AtomicUsize> = (0..7).map(|_| AtomicUsize::new(0)).collect();
            work_together(size, |member| {
                for round in 1..=200 {
                    member.own(&counts).for_each(|(_, count)| {
                        count.fetch_add(1, Ordering::Relaxed);
                    });
                    member.wait();
                    assert!(counts.iter().all(|count| count.load(Ordering::Relaxed) == round));
                    member.wait();
                }
            });
        }
    }

    #[test]
    fn each_item_is_one_threads() {
        let owners: Vec<Mutex<usize>> = (0..10).map(|_| Mutex::new(0)).collect();
        work_together(3, |member| member.own(&owners).for_each(|(place, owner)| *owner.lock().unwrap() += place + 1));
        let owners: Vec<usize> = owners.into_iter().map(|owner| owner.into_inner().unwrap()).collect();
        assert_eq!(owners, (1..=10).collect::<Vec<_>>());
    }

    #[test]
    #[should_panic(expected = "panicked")]
    fn a_panic_is_everyones() {
        work_together(3, |member| {
            assert!(member.index != 1, "a panic");
            member.wait();
        });
    }
}
