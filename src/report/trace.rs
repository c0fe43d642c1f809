//! Traces in Chrome's trace-event format, which Perfetto and chrome://tracing open.
use crate::gpu::{Calibration, PassTime};
use serde_json::{Value, json};

const CPU: u32 = 1;
const GPU: u32 = 2;

/// Writes host and device spans as two named threads on one time axis, in microseconds from the first event.
///
/// `calibration` ties the clocks together, and how far they may be apart is written beside the events. Without it the first
/// GPU span is drawn where the first host span begins, and the GPU thread's name says that its offset is unknown.
/// Spans of a thread do not overlap, and are written in the order in which they begin.
pub fn chrome_trace(cpu: &[PassTime], gpu: &[PassTime], calibration: Option<Calibration>) -> String {
    // A device may count from any moment, so differences need a sign in addition to 64 bits.
    let first = |spans: &[PassTime]| spans.iter().map(|s| i128::from(s.begin_ns)).min().unwrap_or(0);
    let aligned = first(cpu) - first(gpu);
    let begins = |span: &PassTime| i128::from(span.begin_ns);
    let on_host =
        |span: &PassTime| calibration.map_or(begins(span) + aligned, |moment| moment.host_ns_of(span.begin_ns).into());
    let origin = cpu.iter().map(begins).chain(gpu.iter().map(on_host)).min().unwrap_or(0);
    let gpu_name = if calibration.is_some() { "GPU" } else { "GPU (offset to the CPU unknown)" };
    let mut events = vec![name_event("process_name", CPU, "tallow")];
    events.extend([name_event("thread_name", CPU, "CPU"), name_event("thread_name", GPU, gpu_name)]);
    let begins: [&dyn Fn(&PassTime) -> i128; 2] = [&begins, &on_host];
    for ((spans, thread), begins) in [(cpu, CPU), (gpu, GPU)].into_iter().zip(begins) {
        let mut spans: Vec<_> = spans.iter().map(|span| (begins(span) - origin, span)).collect();
        spans.sort_by_key(|(begins, _)| *begins);
        events.extend(spans.iter().map(|(begins, span)| span_event(span, thread, *begins)));
    }
    let deviation = calibration.map(|moment| microseconds(moment.deviation_ns.into()));
    let other = json!({ "clockDeviationMicroseconds": deviation });
    json!({ "displayTimeUnit": "ms", "otherData": other, "traceEvents": events }).to_string()
}

fn name_event(kind: &str, thread: u32, name: &str) -> Value {
    json!({ "ph": "M", "name": kind, "pid": 1, "tid": thread, "args": { "name": name } })
}

fn span_event(span: &PassTime, thread: u32, begin_ns: i128) -> Value {
    let begin_us = microseconds(begin_ns);
    let duration_us = microseconds(span.duration_ns().into());
    json!({ "ph": "X", "name": span.name, "pid": 1, "tid": thread, "ts": begin_us, "dur": duration_us })
}

/// The least number of microseconds that is not below `ns`. Readers multiply by 1000 and cut the rest off, so that a quotient which
/// was rounded down would become one nanosecond less, and a span would begin within the one before.
fn microseconds(ns: i128) -> f64 {
    let quotient = ns as f64 / 1e3;
    if ((quotient * 1e3) as i128) < ns { quotient.next_up() } else { quotient }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(name: &'static str, begin_ns: u64, end_ns: u64) -> PassTime {
        PassTime { name, begin_ns, end_ns }
    }

    /// (thread, ts, dur) of the span of this name.
    fn find(trace: &str, name: &str) -> (u64, f64, f64) {
        let trace: Value = serde_json::from_str(trace).unwrap();
        let event = trace["traceEvents"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap().clone();
        assert_eq!(event["ph"], "X");
        (event["tid"].as_u64().unwrap(), event["ts"].as_f64().unwrap(), event["dur"].as_f64().unwrap())
    }

    #[test]
    fn both_clocks_share_one_axis_in_microseconds() {
        let (cpu, gpu) = ([span("load", 5_000, 9_000)], [span("path", 1_000, 3_500)]);
        // GPU 1000 is host 1000 + 7000: 3 microseconds after the first host event.
        let moment = Calibration { device_ns: 10, host_ns: 7_010, deviation_ns: 1_500, wraps_after_ns: 1 << 64 };
        let trace = chrome_trace(&cpu, &gpu, Some(moment));
        assert_eq!(find(&trace, "load"), (u64::from(CPU), 0.0, 4.0));
        assert_eq!(find(&trace, "path"), (u64::from(GPU), 3.0, 2.5));
        assert!(!trace.contains("unknown") && trace.contains("\"clockDeviationMicroseconds\":1.5"));
    }

    #[test]
    fn passes_before_the_clock_began_anew_stay_before_those_behind_it() {
        let gpu = [span("last", 990, 1_010), span("next", 30, 40)];
        let moment = Calibration { device_ns: 60, host_ns: 5_060, deviation_ns: 0, wraps_after_ns: 1_000 };
        let trace = chrome_trace(&[], &gpu, Some(moment));
        assert_eq!(["last", "next"].map(|name| find(&trace, name).1), [0.0, 0.04]);
    }

    #[test]
    fn every_nanosecond_survives_being_read() {
        let read = |ns: i128| (microseconds(ns) * 1e3) as i128;
        assert_ne!((1001_f64 / 1e3 * 1e3) as i128, 1001, "the plain quotient can fail");
        assert!((0..2_000_000).chain((1 << 50)..(1 << 50) + 10_000).all(|ns| read(ns) == ns));
    }

    #[test]
    fn without_an_offset_both_begin_together_and_the_trace_says_so() {
        let trace = chrome_trace(&[span("load", 5_000, 9_000)], &[span("path", u64::MAX - 9, u64::MAX)], None);
        assert_eq!(find(&trace, "path"), (u64::from(GPU), 0.0, 0.009));
        assert!(trace.contains("unknown"));
        assert!(chrome_trace(&[], &[], None).contains("thread_name"));
    }
}
