//! The thread pool for work on the host, with as many threads as the machine has cores or as the system will start.
use rayon::ThreadPoolBuilder;

/// Runs `work` in the caller's thread pool if it is in one, else in a new pool. That has one thread per core, fewer if the
/// system refuses so many, and in the last resort only the caller's thread. Rayon's global pool would panic instead.
pub fn within<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    // 0 is Rayon's default, which an environment variable may set.
    let counts =
        std::iter::once(0).chain(std::iter::successors(Some(cores / 2), |n| Some(n / 2)).take_while(|&n| n > 0));
    let pool = counts.into_iter().find_map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().ok());
    let alone = || ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    match pool.map_or_else(alone, Ok) {
        Ok(pool) => pool.install(work),
        Err(e) => unreachable!("the caller's thread, which is in no pool, needs no starting: {e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_callers_pool_is_kept_and_a_caller_without_one_gets_one() {
        let pool = ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| within(rayon::current_num_threads)), 3);
        assert!(rayon::current_thread_index().is_none(), "control");
        assert!(within(|| rayon::current_thread_index().is_some()));
    }
}
