; A request for memory before it is needed. prefetch.py calls it. Taichi reads the .bc file beside this file;
; tools/make/assemble_bitcode.py makes it.

target datalayout = "e-m:e-p270:32:32-p271:32:32-p272:64:64-i64:64-f80:128-n8:16:32:64-S128"
target triple = "x86_64-pc-linux-gnu"

declare void @llvm.prefetch.p0i8(i8*, i32, i32, i32)

define void @prefetch(i64* %address) alwaysinline nounwind {
  %value = load i64, i64* %address
  %place = inttoptr i64 %value to i8*
  call void @llvm.prefetch.p0i8(i8* %place, i32 0, i32 3, i32 1)
  ret void
}
