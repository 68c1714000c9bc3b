//! Work that threads share: the results stand in the order of the work, whoever did it.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// As many threads as there are processors.
#[must_use]
pub fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Does `count` pieces of work.
///
/// * `threads`: on how many threads
/// * `start`: what a thread needs for itself, once
/// * `work`: one piece, by number
///
/// # Errors
/// The first error of `start`.
pub fn share<W, T: Send, E: Send>(
    count: usize,
    threads: usize,
    start: impl Fn() -> Result<W, E> + Sync,
    work: impl Fn(usize, &mut W) -> T + Sync,
) -> Result<Vec<T>, E> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Ok(Vec::with_capacity(count)));
    std::thread::scope(|scope| {
        for _ in 0..threads.min(count) {
            scope.spawn(|| {
                let mut mine = Vec::new();
                let result = start().map(|mut worker| {
                    loop {
                        let number = next.fetch_add(1, Ordering::Relaxed);
                        if number >= count {
                            break;
                        }
                        mine.push((number, work(number, &mut worker)));
                    }
                });
                // A thread that panicked has ended the scope with its panic.
                if let Ok(mut done) = done.lock() {
                    match (&mut *done, result) {
                        (Ok(all), Ok(())) => all.extend(mine),
                        (Ok(_), Err(error)) => *done = Err(error),
                        (Err(_), _) => {}
                    }
                }
            });
        }
    });
    let done = done
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    done.map(|mut all: Vec<(usize, T)>| {
        all.sort_by_key(|(number, _)| *number);
        all.into_iter().map(|(_, result)| result).collect()
    })
}
