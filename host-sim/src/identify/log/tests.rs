//! Records of one motion, written in many ways and spoilt in many others.

use super::counter::{Reading, differences, positions};
use super::*;
use crate::machine::motion::PARTS;
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::sync::LazyLock;

const HEADER: &str = "time[s],count[1],applied_current[A]";
const PERIOD: f64 = 1e-3;

/// Acceleration of the default drive's actuator, counts/s² per A.
static PER_AMPERE: LazyLock<f64> = LazyLock::new(|| {
    let drive = Drive::default_drive();
    drive.actuator.force_constant / drive.actuator.mass / drive.encoder.resolution
});

/// Where the actuator is in period `k` if it swings from rest through twice this many counts, and the current
/// that made it in the period before, were it alone.
fn swing(counts: f64, hz: f64, k: f64) -> (f64, f64) {
    let speed = TAU * hz * PERIOD;
    let current = counts * (speed / PERIOD).powi(2) / *PER_AMPERE * ((k - 0.5) * speed).cos();
    let position = counts * (1.0 - (k * speed).cos());
    (position, if k > 0.0 { current } else { 0.0 })
}

/// Time, count and current of the usual motion, counts of 16 bits.
fn usual(rows: usize) -> Vec<(f64, i64, f64)> {
    let row = |k: usize| {
        let (count, current) = swing(40_000.0, 3.0, k as f64);
        (k as f64 * PERIOD, (count as i64) & 0xffff, current)
    };
    (0..rows).map(row).collect()
}

fn written(header: &str, rows: &[(f64, i64, f64)]) -> String {
    let mut text = format!("{header}\n");
    for (time, count, current) in rows {
        let _ = writeln!(text, "{time:.9},{count},{current:.6}");
    }
    text
}

fn parse_for(drive: &Drive, text: &str) -> Result<Log> {
    Log::parse(text.as_bytes(), "log", drive, &Columns::default())
}

fn parse(text: &str) -> Result<Log> {
    parse_for(&Drive::default_drive(), text)
}

/// The sentence by which a record is refused.
fn refused(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

/// But for what the reader is told.
fn silent(log: Log) -> Log {
    Log {
        remarks: Vec::new(),
        ..log
    }
}

#[track_caller]
fn told(log: &Log, words: &str) {
    assert!(
        log.remarks.iter().any(|remark| remark.contains(words)),
        "{words}: {:?}",
        log.remarks
    );
}

/// What spreadsheets and other programs make of a log is the same log; what cannot be told apart is refused by
/// name.
#[test]
fn many_programs_are_read() {
    let plain = written(HEADER, &usual(400));
    let expected = parse(&plain).unwrap();
    assert_eq!(expected.remarks, [""; 0]);
    assert!(expected.at_rest && expected.parts.iter().all(|parts| *parts == PARTS));
    let semicolons = plain.replace(',', ";");
    let aligned = plain.replace(',', "   ").replace('\n', "  \n   ");
    for text in [
        format!("\u{feff}{plain}"),
        semicolons.clone(),
        semicolons.replace('.', ","),
        plain.replace(',', "\t"),
        plain.replace(',', "\t").replace('.', ","),
        format!("sep=;\r\n{}", semicolons.replace('\n', "\r\n")),
        plain.replace(',', " , "),
        plain.replace('\n', ",\n"),
        aligned.clone(),
        aligned.replace('.', ","),
        aligned.replace("time[s]", "time [s]"),
        format!("# of the bench,\n#\n\n{plain}"),
        plain.replace("\n0.1", "\n# still here\n0.1"),
        plain.replace(HEADER, "Time,Count,Applied_Current"),
        plain.replace(HEADER, "time (s),count (counts),applied_current (A)"),
    ] {
        assert_eq!(parse(&text).unwrap(), expected, "{}", &text[..80]);
    }
    let error = refused(&plain.replace('.', ","));
    assert!(error.contains("log:2: has 5 fields"), "{error}");
    assert!(error.contains("decimal comma"), "{error}");
    // Lines are counted as an editor counts them.
    let commented = format!("# one\n\n{plain}").replace("0.000005", "what");
    let wide: Vec<u8> = [0xFF, 0xFE].into_iter().chain(plain.bytes()).collect();
    let error = Log::parse(
        &wide[..],
        "log",
        &Drive::default_drive(),
        &Columns::default(),
    );
    assert!(error.unwrap_err().to_string().contains("UTF-16"));
    let error = refused(&commented.replacen("0.004000000", "x", 1));
    assert!(error.contains("log:8: time[s] = \"x\""), "{error}");
}

/// Other names are taken where the user gives them; a column that is missing is named beside those there are.
#[test]
fn columns_have_the_names_that_are_given() {
    let rows = usual(400);
    let plain = written(HEADER, &rows);
    let expected = parse(&plain).unwrap();
    let read = |columns: &str, text: &str| {
        let columns: Columns = columns.parse().unwrap();
        Log::parse(text.as_bytes(), "log", &Drive::default_drive(), &columns)
    };
    let all = "time=t,count=enc,current=iq";
    for header in ["t,enc,iq", "t[s],enc[1],iq[A]", "t [s],enc,iq (A)"] {
        let text = plain.replace(HEADER, header);
        assert_eq!(read(all, &text).unwrap(), expected, "{header}");
        let error = refused(&text);
        assert!(error.starts_with("log:1: has no column "), "{error}");
        assert!(error.contains(&header.replace(',', ", ")), "{error}");
        assert!(error.contains("--column time=NAME"), "{error}");
    }
    let amperes: Vec<_> = rows.iter().map(|row| (row.0, row.1, 1e3 * row.2)).collect();
    let text = written("time_s,enc,iq[mA]", &amperes);
    let found = read("time=time_s,count=enc,current=iq[mA]", &text).unwrap();
    let apart = found.current.iter().zip(&expected.current);
    assert!(apart.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    let error = refused(&plain.replace("current[A]", "current[kA]"));
    assert!(error.contains("must be one of A, mA"), "{error}");
    let error = refused(plain.split_once('\n').unwrap().1);
    assert!(error.contains("its first line is of numbers"), "{error}");
    for wrong in ["", "time", "time=", "speed=v", "time=a,time=b"] {
        assert!(wrong.parse::<Columns>().is_err(), "{wrong}");
    }
    let parsed: Columns = "time=a".parse().unwrap();
    let both = parsed.with("time=b,mode=c".parse().unwrap());
    assert_eq!(
        (both.time.as_deref(), both.mode.as_deref()),
        (Some("b"), Some("c"))
    );
}

/// A rest before the motion and a day after it change nothing; nor does standing still after it, but for being
/// said.
#[test]
fn rest_and_excess_are_left_out() {
    let text = |rest: usize, periods: usize, stand: usize| {
        let mut rows = Vec::new();
        for k in 0..rest + periods + stand {
            let moving = k.saturating_sub(rest).min(periods) as f64;
            let (count, current) = swing(40_000.0, 3.0, moving);
            rows.push((k as f64 * PERIOD, (count as i64) & 0xffff, current));
        }
        written(HEADER, &rows)
    };
    let plain = parse(&text(0, 1000, 0)).unwrap();
    assert_eq!(parse(&text(5000, 1000, 0)).unwrap(), plain);
    let long = parse(&text(0, MOST + 777, 0)).unwrap();
    assert_eq!((long.left_out, long.position.len()), (777, MOST));
    assert_eq!(long.position[..1000], plain.position[..1000]);
    let stood = parse(&text(0, 900, 3000)).unwrap();
    assert!((1000..=1002).contains(&stood.position.len()));
    assert_eq!(stood.left_out, 3900 - stood.position.len());
    assert_eq!(stood.position[..890], plain.position[..890]);
}

/// Where the drive says what it was doing, that stretch is taken in which it moved most: not the longest, and
/// excitation before closed loop.
#[test]
fn the_stretch_that_moves_most_is_taken() {
    let mut text = String::from("time[s],mode[name],count[1],applied_current[A]\n");
    let mut line = 0;
    let mut add = |mode: &str, counts: f64, rows: usize| {
        for k in 0..rows {
            let (count, current) = swing(counts, 3.0, k as f64);
            let time = f64::from(line) * PERIOD;
            let _ = writeln!(text, "{time:.3},{mode},{},{current:.6}", count as i64);
            line += 1;
        }
    };
    add("Running", 30_000.0, 1000);
    add("Idle", 0.0, 100);
    add("Exciting", 500.0, 3000);
    add("Idle", 0.0, 100);
    add("Exciting", 20_000.0, 1000);
    add("Ready", 0.0, 100);
    let log = parse(&text).unwrap();
    assert!((999..=1000).contains(&log.position.len()));
    let range = plausible::span(&log.position) / 1e-6;
    assert!((range - 40_000.0).abs() < 10.0, "{range}");
    told(&log, "has 2 parts: the one from 4.200 s");
    let log = parse(&text.replace("Exciting", "Idle")).unwrap();
    let range = plausible::span(&log.position) / 1e-6;
    assert!((range - 60_000.0).abs() < 10.0, "{range}");
}

/// A late cycle is an interval of its length, and a long pause ends a part.
#[test]
fn late_cycles_are_intervals_of_their_length() {
    let rows = |late: f64| {
        let mut rows = Vec::new();
        for k in 0..1000 {
            let at = f64::from(k) + if k > 500 { late } else { 0.0 };
            let (count, current) = swing(40_000.0, 3.0, at);
            rows.push((at * PERIOD, count as i64, current));
        }
        rows
    };
    for (late, parts) in [(5.1, 122), (0.3, 26), (1.0, 40), (0.05, 20), (-0.4, 12)] {
        let log = parse(&written(HEADER, &rows(late))).unwrap();
        assert_eq!(log.parts[499], 20);
        assert_eq!(log.parts[500], parts, "{late}");
        assert_eq!(
            log.parts.iter().filter(|parts| **parts != 20).count(),
            usize::from(parts != 20)
        );
        let expected = swing(40_000.0, 3.0, 999.0 + late).0 * 1e-6;
        assert!((log.position[999] - expected).abs() < 2e-6);
        if late > 0.5 {
            told(&log, "1 row is missing or late");
        } else {
            assert_eq!(log.remarks, [""; 0]);
        }
    }
    let parted = parse(&written(HEADER, &rows(3000.0))).unwrap();
    told(&parted, "has 2 parts");
    let mut many = rows(0.0);
    many.retain(|row| !((row.0 / PERIOD).round() as usize).is_multiple_of(4));
    let error = refused(&written(HEADER, &many));
    assert!(error.contains("at most a fifth"), "{error}");
    for back in [0.499, 0.3] {
        let mut wrong = rows(0.0);
        wrong[500].0 = back;
        let error = refused(&written(HEADER, &wrong));
        let expected = if back < 0.4 { "-0.199000" } else { "0.000000" };
        let start = format!("log:502: time[s] is {expected} s after the row before");
        assert!(error.starts_with(&start), "{error}");
    }
}

/// Motions that no machine makes are refused with their row and what was the matter.
#[test]
fn what_no_machine_does_is_refused_by_its_cause() {
    let spoilt = |change: &dyn Fn(usize, &mut i64)| {
        let mut rows = usual(2000);
        for (k, row) in rows.iter_mut().enumerate() {
            let mut count = swing(40_000.0, 3.0, k as f64).0 as i64;
            change(k, &mut count);
            row.1 = count & 0xffff;
        }
        refused(&written(HEADER, &rows))
    };
    let error = spoilt(&|k, count| *count += if k == 700 { 7000 } else { 0 });
    assert!(error.starts_with("log:702: count[1] jumps by"), "{error}");
    assert!(error.contains("one wrong reading"), "{error}");
    let error = spoilt(&|k, count| *count += if k >= 700 { -7000 } else { 0 });
    assert!(error.starts_with("log:702: "), "{error}");
    assert!(error.contains("counts were lost"), "{error}");
    let error = spoilt(&|k, count| *count += if k >= 700 { 20_000 } else { 0 });
    assert!(error.contains("more than a quarter"), "{error}");
    // At 0.75 of a turn of the phase it is fastest: 754 counts per period.
    let error = spoilt(&|k, count| {
        let later = if k >= 750 { k + 5 } else { k };
        *count = swing(40_000.0, 3.0, later as f64).0 as i64;
    });
    assert!(error.contains("5 rows seem to be missing"), "{error}");
    let error = spoilt(&|_, count| *count = count.rem_euclid(12_000));
    assert!(
        error.contains("it seems to start again every 119"),
        "{error}"
    );
}

/// A current is within the drive's limit, give or take what a measurement does, and in amperes.
#[test]
fn currents_are_those_of_the_drive() {
    let scaled = |scale: f64| {
        let mut rows = usual(400);
        let largest = rows.iter().map(|row| row.2.abs()).fold(0.0, f64::max);
        for row in &mut rows {
            row.2 *= scale / largest;
        }
        written(HEADER, &rows)
    };
    assert!(parse(&scaled(2.05)).is_ok());
    let error = refused(&scaled(2.2));
    assert!(
        error.ends_with("is beyond the drive's current_limit of 2 A"),
        "{error}"
    );
    let error = refused(&scaled(500.0));
    assert!(error.contains("applied_current[mA]"), "{error}");
}

/// Positions that do not wrap, in counts or in metres, are the same motion.
#[test]
fn positions_need_no_counter() {
    let drive = Drive::default_drive();
    let plain = parse(&written(HEADER, &usual(2000))).unwrap();
    let texts = |scale: f64, header: &str| {
        let mut text = format!("{header}\n");
        for k in 0..2000 {
            let (count, current) = swing(40_000.0, 3.0, f64::from(k));
            let time = f64::from(k) * PERIOD;
            let place = scale * (count.trunc() + 1e7);
            let _ = writeln!(text, "{time:.3},{place:.9},{current:.6}");
        }
        text
    };
    for (scale, header) in [
        (1.0, HEADER),
        (1e-6, "time[s],position[m],applied_current[A]"),
        (1e-3, "time[s],position[mm],applied_current[A]"),
        (1e-6, "time[s],position,applied_current[A]"),
    ] {
        let log = parse(&texts(scale, header)).unwrap();
        assert_eq!(log.position.len(), plain.position.len(), "{header}");
        for (a, b) in log.position.iter().zip(&plain.position) {
            assert!((a - b).abs() < 1e-8, "{header}: {a} {b}");
        }
    }
    let broken = texts(1.0 + 1e-5, HEADER);
    assert!(parse_for(&drive, &broken).is_ok());
    let error = refused(&texts(1e-6, "time[s],position[rad],applied_current[A]"));
    assert!(error.contains("must be one of m, mm"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Steps below a quarter of the range are followed exactly, whatever width and start.
    #[test]
    fn counters_of_any_width_unwrap(
        bits in 2_u32..=32,
        start in any::<u32>(),
        steps in prop::collection::vec(-1.0_f64..=1.0, 2..200),
    ) {
        let range = 1_i64 << bits;
        let mut truth = vec![i64::from(start) % range];
        for step in steps {
            truth.push(truth[truth.len() - 1] + (step * (range / 4) as f64) as i64);
        }
        let counts: Vec<f64> = truth.iter().map(|at| at.rem_euclid(range) as f64).collect();
        let parts = vec![PARTS; counts.len() - 1];
        let found = positions(&differences(&counts, &parts, Reading::Wrapping(bits)));
        for (found, truth_at) in found.iter().zip(&truth) {
            prop_assert_eq!(*found, (truth_at - truth[0]) as f64);
        }
    }

    /// A record of any counter is read with its width, and any wider one in the file is told the right one.
    #[test]
    fn another_width_is_named(bits in 2_u32..=20, wider in 1_u32..=12, start in any::<u32>()) {
        let range = 1_i64 << bits;
        // A quarter of the range at the fastest.
        let speed = (range as f64 / 4.0 - 1.0).max(1.0);
        let hz: f64 = 3.0;
        let counts = (speed / (TAU * hz * PERIOD)).clamp(50.1, 100_000.0);
        let mut rows = usual(3000);
        for (k, row) in rows.iter_mut().enumerate() {
            let count = swing(counts, hz, k as f64).0 as i64 + i64::from(start);
            row.1 = count.rem_euclid(range);
        }
        let wraps = rows.windows(2).any(|pair| (pair[1].1 - pair[0].1).abs() > range / 2);
        let text = written(HEADER, &rows);
        let mut drive = Drive::default_drive();
        drive.encoder.counter_bits = bits;
        let log = parse_for(&drive, &text).unwrap();
        for (k, position) in log.position.iter().enumerate() {
            let truth = swing(counts, hz, k as f64).0 as i64;
            prop_assert!((position / 1e-6 - truth as f64).abs() < 1e-3);
        }
        drive.encoder.counter_bits = (bits + wider).min(32);
        if wraps {
            let error = parse_for(&drive, &text).unwrap_err().to_string();
            let named = format!("set encoder.counter_bits = {bits}");
            prop_assert!(error.ends_with(&named), "{}", error);
        }
    }

    /// Rows that are missing here and there take nothing from those that are left.
    #[test]
    fn missing_rows_leave_the_others(
        missing in prop::collection::btree_set(30_usize..1990, 1..200),
        start in any::<u16>(),
    ) {
        // So fast that a counter of 16 bits goes round within a few rows.
        let (counts, hz) = (400_000.0, 3.0);
        let rows = (0..2000).filter(|k| !missing.contains(k)).map(|k| {
            let (count, current) = swing(counts, hz, k as f64);
            let count = (count as i64 + i64::from(start)) & 0xffff;
            (k as f64 * PERIOD, count, current)
        });
        let rows: Vec<_> = rows.collect();
        let log = parse(&written(HEADER, &rows)).unwrap();
        prop_assert_eq!(log.position.len(), rows.len());
        let mut at = 0;
        for (k, position) in log.position.iter().enumerate() {
            let period = (rows[k].0 / PERIOD).round();
            let truth = swing(counts, hz, period).0 as i64;
            prop_assert!((position / 1e-6 - truth as f64).abs() < 1e-3);
            prop_assert_eq!(f64::from(at), f64::from(PARTS) * period);
            at += log.parts.get(k).copied().unwrap_or(0);
        }
        told(&log, "missing or late");
    }

    /// Seconds, milliseconds and microseconds are the same record, said in the header or shown by the steps.
    #[test]
    fn units_of_time_make_no_difference(rows in 300_usize..600, start in 0_u32..100_000) {
        let rows: Vec<_> = usual(rows)
            .into_iter()
            .map(|row| (row.0 + f64::from(start) * PERIOD, row.1, row.2))
            .collect();
        let expected = parse(&written(HEADER, &rows)).unwrap();
        for (unit, scale) in [("ms", 1e3), ("us", 1e6)] {
            let scaled: Vec<_> = rows.iter().map(|row| (scale * row.0, row.1, row.2)).collect();
            for time in ["time[s]".to_owned(), "time".into(), format!("time[{unit}]"), format!("time_{unit}")] {
                let header = HEADER.replace("time[s]", &time);
                let log = parse(&written(&header, &scaled)).unwrap();
                if time.contains(unit) {
                    prop_assert_eq!(&log.remarks, &[""; 0]);
                } else {
                    told(&log, "seconds, the drive file's sample time being 1 ms");
                }
                prop_assert_eq!(silent(log), expected.clone());
            }
        }
    }

    /// The period is the record's own, to a millionth, whatever the drive file says.
    #[test]
    fn the_period_is_found(period in 0.3e-3_f64..3e-3, start in 0.0_f64..100.0, late in 300_usize..900) {
        let rows: Vec<_> = usual(1000)
            .into_iter()
            .enumerate()
            .map(|(k, row)| {
                let extra = if k > late { 0.37 } else { 0.0 };
                (start + (k as f64 + extra) * period, row.1, row.2)
            })
            .collect();
        let log = parse(&written(HEADER, &rows)).unwrap();
        prop_assert!((log.period / period - 1.0).abs() < 1e-6, "{} {period}", log.period);
        let says = log.remarks.iter().any(|remark| remark.contains("the record's is used"));
        prop_assert_eq!(says, (period / PERIOD - 1.0).abs() > 0.01);
        prop_assert_eq!(log.parts[late], 27);
    }

    /// Times that are written coarsely jitter no more than they are written.
    #[test]
    fn coarse_times_are_regular(period in 0.8e-3_f64..1.2e-3) {
        let rows: Vec<_> = usual(2000)
            .into_iter()
            .enumerate()
            .map(|(k, row)| (k as f64 * period, row.1, row.2))
            .collect();
        let mut text = format!("{HEADER}\n");
        for (time, count, current) in rows {
            let _ = writeln!(text, "{time:.4},{count},{current:.6}");
        }
        let log = parse(&text).unwrap();
        prop_assert!((log.period / period - 1.0).abs() < 1e-4, "{} {period}", log.period);
        prop_assert!(log.parts.iter().all(|parts| *parts == PARTS));
    }

    /// From rest whatever current is played; in motion where a record begins while the actuator is fast.
    #[test]
    fn a_beginning_in_motion_is_noticed(
        currents in prop::collection::vec(-2.0_f64..2.0, 600),
        mass in 0.5_f64..2.0,
        cut in 100_usize..300,
    ) {
        let drive = Drive::default_drive();
        let per_ampere = drive.actuator.force_constant / (mass * drive.actuator.mass);
        let (mut position, mut velocity) = (0.0_f64, 0.0_f64);
        let mut rows = vec![(0.0, 0, 0.0)];
        let mut speeds = vec![0.0];
        for (k, current) in currents.iter().enumerate() {
            let acceleration = per_ampere * current;
            position += velocity * PERIOD + 0.5 * acceleration * PERIOD * PERIOD;
            velocity += acceleration * PERIOD;
            let count = ((position / 1e-6).round() as i64) & 0xffff;
            rows.push(((k + 1) as f64 * PERIOD, count, *current));
            speeds.push(velocity);
        }
        prop_assume!(rows.len() > 500 && position.abs() > 1e-3);
        let log = parse(&written(HEADER, &rows));
        prop_assume!(log.is_ok());
        let log = log.unwrap();
        prop_assert!(log.at_rest);
        prop_assert_eq!(log.remarks, [""; 0]);
        // Faster than the largest current makes it in the rows that are looked at.
        if speeds[cut].abs() > 20.0 * 3.0 * 218.0 * PERIOD {
            let log = parse(&written(HEADER, &rows[cut..])).unwrap();
            prop_assert!(!log.at_rest);
            told(&log, "begins in motion");
        }
    }
}
