; Operations of a CPU's vector units for which Taichi has no function. lane_arithmetic.py calls them. Taichi reads the .bc file
; beside this file; tools/make/assemble_bitcode.py makes it.
;
; `fmuladd` computes a product and a sum with one rounding, if the processor has such an instruction. The flags `arcp afn` allow
; LLVM to start from the processor's approximate inverse root, if it has one, and to improve it by one step of Newton's method.
; Only the last function names an instruction: the approximate inverse root of AVX-512, which LLVM never uses by itself in f64.

target datalayout = "e-m:e-p270:32:32-p271:32:32-p272:64:64-i64:64-f80:128-n8:16:32:64-S128"
target triple = "x86_64-pc-linux-gnu"

declare <16 x float> @llvm.fmuladd.v16f32(<16 x float>, <16 x float>, <16 x float>)

define void @multiply_add_f32(<16 x float>* %a, <16 x float>* %b, <16 x float>* %c, <16 x float>* %out) alwaysinline nounwind {
  %x = load <16 x float>, <16 x float>* %a
  %y = load <16 x float>, <16 x float>* %b
  %z = load <16 x float>, <16 x float>* %c
  %sum = call <16 x float> @llvm.fmuladd.v16f32(<16 x float> %x, <16 x float> %y, <16 x float> %z)
  store <16 x float> %sum, <16 x float>* %out
  ret void
}

declare <8 x double> @llvm.fmuladd.v8f64(<8 x double>, <8 x double>, <8 x double>)

define void @multiply_add_f64(<8 x double>* %a, <8 x double>* %b, <8 x double>* %c, <8 x double>* %out) alwaysinline nounwind {
  %x = load <8 x double>, <8 x double>* %a
  %y = load <8 x double>, <8 x double>* %b
  %z = load <8 x double>, <8 x double>* %c
  %sum = call <8 x double> @llvm.fmuladd.v8f64(<8 x double> %x, <8 x double> %y, <8 x double> %z)
  store <8 x double> %sum, <8 x double>* %out
  ret void
}

declare <16 x float> @llvm.sqrt.v16f32(<16 x float>)

define void @inverse_sqrt_f32(<16 x float>* %a, <16 x float>* %out) alwaysinline nounwind {
  %x = load <16 x float>, <16 x float>* %a
  %root = call contract arcp afn reassoc ninf nnan <16 x float> @llvm.sqrt.v16f32(<16 x float> %x)
  %inverse = fdiv contract arcp afn reassoc ninf nnan <16 x float> <float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0, float 1.0>, %root
  store <16 x float> %inverse, <16 x float>* %out
  ret void
}

declare <8 x double> @llvm.fma.v8f64(<8 x double>, <8 x double>, <8 x double>)
declare <8 x double> @llvm.x86.avx512.rsqrt14.pd.512(<8 x double>, <8 x double>, i8)

; With y = (1 + d)/sqrt(x), |d| < 2^-14, and e = 1 - x y^2, 1/sqrt(x) = y (1 - e)^(-1/2) = y (1 + e/2 + 3/8 e^2 + 5/16 e^3 + ...):
; the terms that are left out are less than 35/128 e^4 < 2^-53.
define void @inverse_sqrt_f64(<8 x double>* %a, <8 x double>* %out) alwaysinline nounwind {
  %x = load <8 x double>, <8 x double>* %a
  %y = call <8 x double> @llvm.x86.avx512.rsqrt14.pd.512(<8 x double> %x, <8 x double> zeroinitializer, i8 -1)
  %xy = fmul <8 x double> %x, %y
  %minus = fneg <8 x double> %xy
  %e = call <8 x double> @llvm.fma.v8f64(<8 x double> %minus, <8 x double> %y, <8 x double> <double 1.0, double 1.0, double 1.0, double 1.0, double 1.0, double 1.0, double 1.0, double 1.0>)
  %cubic = call <8 x double> @llvm.fma.v8f64(<8 x double> %e, <8 x double> <double 0.3125, double 0.3125, double 0.3125, double 0.3125, double 0.3125, double 0.3125, double 0.3125, double 0.3125>, <8 x double> <double 0.375, double 0.375, double 0.375, double 0.375, double 0.375, double 0.375, double 0.375, double 0.375>)
  %square = call <8 x double> @llvm.fma.v8f64(<8 x double> %e, <8 x double> %cubic, <8 x double> <double 0.5, double 0.5, double 0.5, double 0.5, double 0.5, double 0.5, double 0.5, double 0.5>)
  %ye = fmul <8 x double> %y, %e
  %inverse = call <8 x double> @llvm.fma.v8f64(<8 x double> %ye, <8 x double> %square, <8 x double> %y)
  store <8 x double> %inverse, <8 x double>* %out
  ret void
}
