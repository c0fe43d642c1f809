//! Traces in Chrome's trace-event format, which Perfetto and chrome://tracing open.
use crate::gpu::PassTime;
use serde_json::{Value, json};

const CPU: u32 = 1;
const GPU: u32 = 2;

/// Writes host and device spans as two named threads on one time axis, in microseconds from the first event.
///
/// `host_minus_gpu_ns` is the host clock minus the GPU clock at one moment (calibrated timestamps). Without it the first
/// GPU span is drawn where the first host span begins, and the GPU thread's name says that its offset is unknown.
pub fn chrome_trace(cpu: &[PassTime], gpu: &[PassTime], host_minus_gpu_ns: Option<i64>) -> String {
    // A device may count from any moment, so differences need a sign in addition to 64 bits.
    let first = |spans: &[PassTime]| spans.iter().map(|s| i128::from(s.begin_ns)).min();
    let aligned = || first(cpu).unwrap_or(0) - first(gpu).unwrap_or(0);
    let offset = host_minus_gpu_ns.map_or_else(aligned, i128::from);
    let origin = first(cpu).into_iter().chain(first(gpu).map(|ns| ns + offset)).min().unwrap_or(0);
    let gpu_name = if host_minus_gpu_ns.is_some() { "GPU" } else { "GPU (offset to the CPU unknown)" };
    let mut events = vec![name_event("process_name", CPU, "tallow")];
    events.extend([name_event("thread_name", CPU, "CPU"), name_event("thread_name", GPU, gpu_name)]);
    events.extend(cpu.iter().map(|s| span_event(s, CPU, -origin)));
    events.extend(gpu.iter().map(|s| span_event(s, GPU, offset - origin)));
    json!({ "displayTimeUnit": "ms", "traceEvents": events }).to_string()
}

fn name_event(kind: &str, thread: u32, name: &str) -> Value {
    json!({ "ph": "M", "name": kind, "pid": 1, "tid": thread, "args": { "name": name } })
}

fn span_event(span: &PassTime, thread: u32, shift_ns: i128) -> Value {
    let begin_us = (i128::from(span.begin_ns) + shift_ns) as f64 / 1e3;
    let duration_us = span.duration_ns() as f64 / 1e3;
    json!({ "ph": "X", "name": span.name, "pid": 1, "tid": thread, "ts": begin_us, "dur": duration_us })
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
        let trace = chrome_trace(&cpu, &gpu, Some(7_000));
        assert_eq!(find(&trace, "load"), (u64::from(CPU), 0.0, 4.0));
        assert_eq!(find(&trace, "path"), (u64::from(GPU), 3.0, 2.5));
        assert!(!trace.contains("unknown"));
    }

    #[test]
    fn without_an_offset_both_begin_together_and_the_trace_says_so() {
        let trace = chrome_trace(&[span("load", 5_000, 9_000)], &[span("path", u64::MAX - 9, u64::MAX)], None);
        assert_eq!(find(&trace, "path"), (u64::from(GPU), 0.0, 0.009));
        assert!(trace.contains("unknown"));
        assert!(chrome_trace(&[], &[], None).contains("thread_name"));
    }
}
