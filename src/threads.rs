//! The thread pool for work on the host, with as many threads as the machine has cores or as the system will start.
use crate::error::Result;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::OnceLock;

/// Runs `work` in the caller's thread pool if it is in one, else in a new pool. That has one thread per core, fewer if the
/// system refuses so many, and in the last resort only the caller's thread. Rayon's global pool would panic instead.
pub fn within<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let mut made = None;
    run(&mut once(work, &mut made));
    made.unwrap_or_else(|| unreachable!("the work is done"))
}

/// As [`within`], in a pool that the process keeps: for work of every frame. It must neither hold a lock while threads share it nor wait
/// for others, since a thread of the pool may take up what another caller waits for.
pub fn within_kept<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    if rayon::current_thread_index().is_some() {
        return work();
    }
    match POOL.get_or_init(pool) {
        Some(pool) => pool.install(work),
        None => within(work),
    }
}

/// A job that any number of types share, so that what Rayon makes of it is compiled once: `work`, and where its result goes.
fn once<T: Send>(work: impl FnOnce() -> T + Send, made: &mut Option<T>) -> impl FnMut() + Send {
    let mut work = Some(work);
    move || *made = work.take().map(|work| work())
}

type Job<'a> = Box<dyn FnMut() + Send + 'a>;

/// Does all jobs, side by side.
fn all(jobs: &mut [Job]) {
    run(&mut || jobs.par_iter_mut().for_each(|job| job()));
}

fn run(work: &mut (dyn FnMut() + Send)) {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let alone = || ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    match pool().map_or_else(alone, Ok) {
        Ok(pool) => pool.install(work),
        Err(e) => unreachable!("the caller's thread, which is in no pool, needs no starting: {e}"),
    }
}

/// A pool of as many threads as the system will start; `None` if that is none.
fn pool() -> Option<ThreadPool> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    // 0 is Rayon's default, which an environment variable may set.
    let counts =
        std::iter::once(0).chain(std::iter::successors(Some(cores / 2), |n| Some(n / 2)).take_while(|&n| n > 0));
    counts.into_iter().find_map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().ok())
}

/// Makes two things side by side, such as kernels: a driver compiles as many at a time as it is asked for.
///
/// # Errors
/// Those of the first, then those of the second.
pub fn both<A: Send, B: Send>(
    first: impl FnOnce() -> Result<A> + Send,
    second: impl FnOnce() -> Result<B> + Send,
) -> Result<(A, B)> {
    let (mut a, mut b) = (None, None);
    all(&mut [Box::new(once(first, &mut a)), Box::new(once(second, &mut b))]);
    a.zip(b).map_or_else(|| unreachable!("both are made"), |(a, b)| Ok((a?, b?)))
}

/// Makes one thing of each item, likewise.
///
/// # Errors
/// Those of the first that fails.
pub fn each<T: Send, U: Send, const N: usize>(
    items: [T; N],
    make: impl Fn(T) -> Result<U> + Sync + Send,
) -> Result<[U; N]> {
    let mut made = [const { None }; N];
    let jobs = items.into_iter().zip(&mut made);
    all(&mut jobs.map(|(item, made)| -> Job { Box::new(once(|| make(item), made)) }).collect::<Vec<_>>());
    let made = made.into_iter().flatten().collect::<Result<Vec<_>>>()?;
    Ok(made.try_into().unwrap_or_else(|_| unreachable!("one thing of each item")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use std::collections::BTreeSet;

    #[test]
    fn things_made_side_by_side_keep_their_order_and_the_first_error_is_told() {
        let odd = |n: u32| if n % 2 == 1 { Ok(10 * n) } else { Err(Error::Usage(format!("{n} is even"))) };
        assert_eq!(each([3, 5, 1], odd).unwrap(), [30, 50, 10]);
        assert_eq!(each([3, 4, 6], odd).unwrap_err().to_string(), "4 is even");
        assert_eq!(both(|| odd(3), || odd(7)).unwrap(), (30, 70));
        assert_eq!(both(|| odd(4), || odd(6)).unwrap_err().to_string(), "4 is even");
    }

    #[test]
    fn the_callers_pool_is_kept_and_a_caller_without_one_gets_one() {
        let pool = ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| within(rayon::current_num_threads)), 3);
        assert!(rayon::current_thread_index().is_none(), "control");
        assert!(within(|| rayon::current_thread_index().is_some()));
    }

    #[test]
    fn work_of_every_frame_finds_the_threads_of_the_last_one() {
        let ids =
            || rayon::broadcast(|_| format!("{:?}", std::thread::current().id())).into_iter().collect::<BTreeSet<_>>();
        let (kept, made) = (|| within_kept(ids), || within(ids));
        assert_eq!(kept(), kept());
        assert_ne!(made(), made(), "control");
    }
}
