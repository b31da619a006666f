//! What a run spends, stage by stage.

use serde::Serialize;
use std::time::Instant;

/// What one stage cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// Its name.
    pub stage: String,
    /// Wall clock.
    pub seconds: f64,
    /// The most memory the process has held so far; `None` where the system does not tell.
    pub peak_bytes: Option<u64>,
}

/// Hears of the progress of long work.
pub trait Observer {
    /// A stage begins.
    fn began(&self, stage: &str);
    /// A stage has done `done` of `total` steps; 0 where nobody knows how many there are.
    fn advanced(&self, done: usize, total: usize);
    /// A stage ended.
    fn ended(&self, stage: &Stage);
    /// Something the user should know, in one line.
    fn noted(&self, note: &str);
}

/// Hears nothing.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Observer for Silent {
    fn began(&self, _stage: &str) {}
    fn advanced(&self, _done: usize, _total: usize) {}
    fn ended(&self, _stage: &Stage) {}
    fn noted(&self, _note: &str) {}
}

/// Runs stages and keeps what they cost.
pub struct Stages<'a> {
    observer: &'a dyn Observer,
    finished: Vec<Stage>,
}

impl std::fmt::Debug for Stages<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stages").field("finished", &self.finished).finish_non_exhaustive()
    }
}

impl<'a> Stages<'a> {
    /// No stages yet.
    pub fn new(observer: &'a dyn Observer) -> Self {
        Self { observer, finished: Vec::new() }
    }

    /// Runs one stage.
    pub fn run<T>(&mut self, name: &str, work: impl FnOnce(&dyn Observer) -> T) -> T {
        self.observer.began(name);
        let start = Instant::now();
        let result = work(self.observer);
        let stage = Stage { stage: name.to_owned(), seconds: start.elapsed().as_secs_f64(), peak_bytes: peak_bytes() };
        self.observer.ended(&stage);
        self.finished.push(stage);
        result
    }

    /// Who hears of the progress.
    pub fn observer(&self) -> &'a dyn Observer {
        self.observer
    }

    /// What has been run so far.
    pub fn finished(&self) -> &[Stage] {
        &self.finished
    }
}

/// The most memory this process has held (`VmHWM`), where the system tells.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// The middle of several timings, or the mean of the two in the middle; zero of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n => (values[(n - 1) / 2] + values[n / 2]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_have_their_textbook_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(Vec::new()), 0.0);
    }

    #[test]
    fn stages_are_kept_in_order_with_their_cost() {
        let mut stages = Stages::new(&Silent);
        assert_eq!(stages.run("one", |_| 1), 1);
        stages.run("two", |_| ());
        let names: Vec<&str> = stages.finished().iter().map(|s| s.stage.as_str()).collect();
        assert_eq!(names, ["one", "two"]);
        if cfg!(target_os = "linux") {
            assert!(stages.finished()[1].peak_bytes.is_some_and(|bytes| bytes > 100_000));
        }
    }
}
