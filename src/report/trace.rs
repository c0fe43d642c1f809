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
    let first = |spans: &[PassTime]| spans.iter().map(|s| i128::from(s.begin_ns)).min();
    let aligned = || first(cpu).unwrap_or(0) - first(gpu).unwrap_or(0);
    let offset = calibration.map_or_else(aligned, |moment| i128::from(moment.host_minus_device_ns()));
    let origin = first(cpu).into_iter().chain(first(gpu).map(|ns| ns + offset)).min().unwrap_or(0);
    let gpu_name = if calibration.is_some() { "GPU" } else { "GPU (offset to the CPU unknown)" };
    let mut events = vec![name_event("process_name", CPU, "tallow")];
    events.extend([name_event("thread_name", CPU, "CPU"), name_event("thread_name", GPU, gpu_name)]);
    for (spans, thread, shift) in [(cpu, CPU, -origin), (gpu, GPU, offset - origin)] {
        let mut spans = spans.to_vec();
        spans.sort_by_key(|span| span.begin_ns);
        events.extend(spans.iter().map(|span| span_event(span, thread, shift)));
    }
    let deviation = calibration.map(|moment| microseconds(moment.deviation_ns.into()));
    let other = json!({ "clockDeviationMicroseconds": deviation });
    json!({ "displayTimeUnit": "ms", "otherData": other, "traceEvents": events }).to_string()
}

fn name_event(kind: &str, thread: u32, name: &str) -> Value {
    json!({ "ph": "M", "name": kind, "pid": 1, "tid": thread, "args": { "name": name } })
}

fn span_event(span: &PassTime, thread: u32, shift_ns: i128) -> Value {
    let begin_us = microseconds(i128::from(span.begin_ns) + shift_ns);
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
        let moment = Calibration { device_ns: 10, host_ns: 7_010, deviation_ns: 1_500 };
        let trace = chrome_trace(&cpu, &gpu, Some(moment));
        assert_eq!(find(&trace, "load"), (u64::from(CPU), 0.0, 4.0));
        assert_eq!(find(&trace, "path"), (u64::from(GPU), 3.0, 2.5));
        assert!(!trace.contains("unknown") && trace.contains("\"clockDeviationMicroseconds\":1.5"));
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
