//! The pointers of C callers, checked as far as possible.
//!
//! Rust cannot check what a pointer points at. The `# Safety` sections of the header state it, and
//! the functions here turn such pointers into references, so that all other code is safe.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::ptr::null_mut;

use infer_cpu::Options;

use crate::failure::{Failure, guard_status};
use crate::options::EdgepuckOptions;
use crate::status::EdgepuckStatus;

/// The object that `pointer`, the argument called `name`, points at.
///
/// # Safety
/// If it is neither null nor misaligned, it points at a `T` that nobody changes during `'a`.
pub unsafe fn shared<'a, T>(pointer: *const T, name: &'static str) -> Result<&'a T, Failure> {
    check(pointer, name)?;
    // SAFETY: not null and aligned; the header requires a `T` there.
    Ok(unsafe { &*pointer })
}

/// The object that `pointer`, the argument called `name`, points at, for changes.
///
/// # Safety
/// If it is neither null nor misaligned, it points at a `T` that nobody else uses during `'a`.
pub unsafe fn exclusive<'a, T>(pointer: *mut T, name: &'static str) -> Result<&'a mut T, Failure> {
    check(pointer, name)?;
    // SAFETY: not null and aligned; the header requires a `T` there that no other thread uses.
    Ok(unsafe { &mut *pointer })
}

/// The memory that `out`, an argument of this name, points at.
///
/// # Safety
/// If it is neither null nor misaligned, a `T` may be written there, and nobody else uses it during
/// `'a`.
pub unsafe fn out<'a, T>(out: *mut T) -> Result<&'a mut MaybeUninit<T>, Failure> {
    // SAFETY: the header requires memory for a `T`, which is a valid `MaybeUninit`.
    unsafe { exclusive(out.cast(), "out") }
}

/// Writes the address of the object that `make` returns to `out`, or null if it fails. [`free`]
/// takes the address back.
///
/// # Safety
/// As for [`out`].
pub unsafe fn make<T>(
    out: *mut *mut T,
    make: impl FnOnce() -> Result<T, Failure>,
) -> EdgepuckStatus {
    guard_status(|| {
        // SAFETY: the header requires memory for an address at `out`.
        let out = unsafe { self::out(out) }?.write(null_mut());
        *out = Box::into_raw(Box::new(make()?));
        Ok(())
    })
}

/// Drops an object of [`make`], if `pointer` is not null.
///
/// # Safety
/// `pointer` is null or comes from [`make`], and nobody uses it now or later.
pub unsafe fn free<T>(pointer: *mut T) {
    if pointer.is_null() {
        return;
    }
    // SAFETY: `make` got the address from `Box::into_raw`, and the header forbids other uses.
    let object = unsafe { Box::from_raw(pointer) };
    // There is no status to return; a panic leaves its message.
    let _ = guard_status(|| {
        drop(object);
        Ok(())
    });
}

/// The options at `pointer`; the defaults if it is null.
///
/// # Safety
/// `pointer` is null or points at options whose words are null or NUL-terminated strings.
pub unsafe fn options(pointer: *const EdgepuckOptions) -> Result<Options, Failure> {
    match pointer.is_null() {
        true => Ok(Options::default()),
        // SAFETY: the header requires valid options with words that are null or NUL-terminated.
        false => unsafe { shared(pointer, "options")?.read() },
    }
}

/// Checks that `pointer`, the argument called `name`, is not null and is aligned for `T`.
pub fn check<T>(pointer: *const T, name: &'static str) -> Result<(), Failure> {
    match pointer.is_null() || !pointer.is_aligned() {
        true => {
            let message = format!(
                "expected `{name}` to be an aligned pointer, found a null or misaligned one"
            );
            Err(Failure::new(EdgepuckStatus::BadPointer, message))
        }
        false => Ok(()),
    }
}

/// The points of a cloud, `[n, 3]`.
///
/// # Safety
/// If `xyz` is neither null nor misaligned, `3 n` floats lie there that nobody changes during `'a`.
pub unsafe fn cloud<'a>(xyz: *const f32, n: usize) -> Result<&'a [[f32; 3]], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    check(xyz, "xyz")?;
    match n.checked_mul(size_of::<[f32; 3]>()) {
        Some(n_bytes) if isize::try_from(n_bytes).is_ok() => {
            // SAFETY: not null, aligned, and not too long for a slice; the header requires `3 n`
            // floats there.
            Ok(unsafe { std::slice::from_raw_parts(xyz.cast(), n) })
        }
        _ => {
            let message = format!("expected a cloud that fits in memory, found {n} points");
            Err(Failure::new(EdgepuckStatus::BadCloud, message))
        }
    }
}

/// The bytes of a packet.
///
/// # Safety
/// If `packet` is not null, `n` bytes lie there that nobody changes during `'a`.
pub unsafe fn bytes<'a>(packet: *const u8, n: usize) -> Result<&'a [u8], Failure> {
    check(packet, "packet")?;
    if isize::try_from(n).is_err() {
        let message = format!("expected a packet that fits in memory, found {n} bytes");
        return Err(Failure::new(EdgepuckStatus::BadPointer, message));
    }
    // SAFETY: not null, and not too long for a slice; the header requires `n` bytes there.
    Ok(unsafe { std::slice::from_raw_parts(packet, n) })
}

/// The path at `pointer`: bytes as they are on Unix, UTF-8 elsewhere.
///
/// # Safety
/// If it is not null, it is a NUL-terminated string.
pub unsafe fn path(pointer: *const c_char) -> Result<PathBuf, Failure> {
    check(pointer, "path")?;
    // SAFETY: not null; the header requires a NUL-terminated string.
    let path = unsafe { CStr::from_ptr(pointer) };
    #[cfg(unix)]
    let path: &std::ffi::OsStr = std::os::unix::ffi::OsStrExt::from_bytes(path.to_bytes());
    #[cfg(not(unix))]
    let path = path.to_string_lossy().into_owned();
    Ok(PathBuf::from(path))
}
