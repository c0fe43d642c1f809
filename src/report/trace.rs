//! Chrome's trace-event format, which Perfetto and chrome://tracing open.
use super::table::PassTime;
use serde_json::{Value, json};

const CPU: u32 = 1;
const GPU: u32 = 2;

/// Host and device spans as two named threads on one time axis, in microseconds from the first event.
///
/// `host_minus_gpu_ns` is the host clock minus the GPU clock at one moment (calibrated timestamps). Without it the first
/// GPU span is drawn where the first host span begins, and the GPU thread's name says that its offset is unknown.
pub fn chrome_trace(cpu: &[PassTime], gpu: &[PassTime], host_minus_gpu_ns: Option<i64>) -> String {
    let first = |spans: &[PassTime]| spans.iter().map(|s| s.begin_ns).min();
    let aligned = first(cpu).unwrap_or(0) as i64 - first(gpu).unwrap_or(0) as i64;
    let offset = i128::from(host_minus_gpu_ns.unwrap_or(aligned));
    // 128 bits: a device may count from any moment, so that neither clock fits the other's range.
    let cpu_begin = first(cpu).map(i128::from);
    let gpu_begin = first(gpu).map(|ns| i128::from(ns) + offset);
    let origin = cpu_begin.into_iter().chain(gpu_begin).min().unwrap_or(0);
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
    let begin_us = (i128::from(span.begin_ns) + shift_ns) as f64 * 1e-3;
    let duration_us = span.end_ns.saturating_sub(span.begin_ns) as f64 * 1e-3;
    json!({ "ph": "X", "name": span.name, "pid": 1, "tid": thread, "ts": begin_us, "dur": duration_us })
}
