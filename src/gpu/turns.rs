//! Who may use a buffer's memory: the host, one thread at a time, or any number of submissions, in the order in which they come.
use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// A line before one buffer. Who comes takes a number and is let in once all before are: a submission then at once, and the host when the
/// submissions before it are complete. Submissions that come while the host waits stand behind it, so that threads that submit step after
/// step do not keep it out for ever, nor it them.
///
/// Nobody waits for ever, since everyone who waits does so at the last buffer that it has come to: a submission enters its buffers in the
/// order of their addresses, and the host, inside of one, neither enters another nor submits. Of the buffers at which somebody waits, look
/// at the last in that order. The first in its line waits for the host, which goes when it has copied, or for submissions, all of
/// which have entered their other buffers and run.
#[derive(Default)]
pub(super) struct Turns {
    line: Mutex<Line>,
    /// Told when the line moves or a submission is complete.
    moved: Condvar,
}

#[derive(Default)]
struct Line {
    /// Submissions that are let in and not complete.
    submissions: usize,
    /// Number of who comes next.
    next: u64,
    /// Number of who is let in next, or of the host while it is inside.
    turn: u64,
}

impl Turns {
    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the line, and wakes who waits in it.
    fn shift(&self, change: impl FnOnce(&mut Line)) {
        change(&mut self.line());
        self.moved.notify_all();
    }

    /// Takes a number, and waits until all who came before are let in and `allows` says yes of those who are inside.
    fn wait(&self, allows: impl Fn(&Line) -> bool) {
        let mut line = self.line();
        let number = line.next;
        line.next += 1;
        let waits = |line: &mut Line| line.turn != number || !allows(line);
        drop(self.moved.wait_while(line, waits).unwrap_or_else(PoisonError::into_inner));
    }

    /// Lets the host in, until what is returned is dropped. Meanwhile this thread may neither enter another buffer nor submit.
    pub fn host(&self) -> Host<'_> {
        self.wait(|line| line.submissions == 0);
        Host(self)
    }

    /// Lets a submission in to all of these, each once, until what is returned is dropped.
    pub fn submission<'a>(of: impl IntoIterator<Item = &'a Self>) -> Vec<Submission<'a>> {
        let in_order: BTreeMap<_, _> = of.into_iter().map(|turns| (std::ptr::from_ref(turns), turns)).collect();
        in_order.into_values().map(Self::enter).collect()
    }

    fn enter(&self) -> Submission<'_> {
        self.wait(|_| true);
        self.shift(|line| {
            line.submissions += 1;
            line.turn += 1;
        });
        Submission(self)
    }
}

/// The host is inside.
pub(super) struct Host<'a>(&'a Turns);

impl Drop for Host<'_> {
    fn drop(&mut self) {
        self.0.shift(|line| line.turn += 1);
    }
}

/// A submission is inside.
pub(super) struct Submission<'a>(&'a Turns);

impl Drop for Submission<'_> {
    fn drop(&mut self) {
        self.0.shift(|line| line.submissions -= 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;
    use std::time::Instant;

    /// Waits until so many have come, and says whether they have; 10 s at most, so that a test fails rather than hangs.
    fn come(turns: &Turns, count: u64) -> bool {
        let began = Instant::now();
        while turns.line().next < count && began.elapsed().as_secs() < 10 {
            thread::yield_now();
        }
        turns.line().next == count
    }

    #[test]
    fn a_submission_that_comes_after_the_host_is_let_in_after_it() {
        let (turns, order) = (Turns::default(), Mutex::new(Vec::new()));
        let note = |what| order.lock().unwrap().push(what);
        let runs = turns.enter();
        thread::scope(|scope| {
            scope.spawn(|| {
                let _inside = turns.host();
                note("host");
            });
            assert!(come(&turns, 2));
            scope.spawn(|| {
                let _inside = turns.enter();
                note("submission");
            });
            assert!(come(&turns, 3) && order.lock().unwrap().is_empty(), "both wait");
            drop(runs);
        });
        assert_eq!(*order.lock().unwrap(), ["host", "submission"]);
    }

    #[test]
    fn submissions_do_not_wait_for_each_other_and_who_panics_leaves() {
        let turns = Turns::default();
        drop([turns.enter(), turns.enter()]);
        for is_host in [true, false] {
            let ended = thread::scope(|scope| {
                let inside = || {
                    let _inside = (is_host.then(|| turns.host()), (!is_host).then(|| turns.enter()));
                    panic!("as a caller's code might");
                };
                scope.spawn(inside).join()
            });
            let line = turns.line();
            assert!(ended.is_err() && line.submissions == 0 && line.turn == line.next, "nobody is inside");
        }
    }

    #[test]
    fn a_submission_enters_in_order_and_once() {
        for order in [[0, 1, 0], [1, 0, 1]] {
            let all = [Turns::default(), Turns::default()];
            let host = all[0].host();
            thread::scope(|scope| {
                let entered = scope.spawn(|| {
                    let _inside = Turns::submission(order.map(|index: usize| &all[index]));
                    all.each_ref().map(|turns| turns.line().submissions)
                });
                assert!(come(&all[0], 2) && come(&all[1], 0), "{order:?}: it waits at the first");
                drop(host);
                assert_eq!(entered.join().unwrap(), [1, 1], "{order:?}");
            });
        }
    }
}
