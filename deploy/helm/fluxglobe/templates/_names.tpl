{{/* Names and labels that every object shares. */}}

{{/* Short enough for a pod of the longest-named service to stay below the 64 bytes that a Kafka instance may have. */}}
{{- define "fluxglobe.fullname" -}}
{{- if contains .Chart.Name .Release.Name }}{{ .Release.Name | trunc 30 | trimSuffix "-" }}
{{- else }}{{ printf "%s-%s" .Release.Name .Chart.Name | trunc 30 | trimSuffix "-" }}{{ end }}
{{- end }}

{{/* What selects the pods of one service: dict "root" $ "service" NAME. It never changes between versions. */}}
{{- define "fluxglobe.selector" -}}
app.kubernetes.io/name: {{ .root.Chart.Name }}
app.kubernetes.io/instance: {{ .root.Release.Name }}
app.kubernetes.io/component: {{ .service }}
{{- end }}

{{- define "fluxglobe.labels" -}}
{{ include "fluxglobe.selector" . }}
app.kubernetes.io/version: {{ .root.Chart.AppVersion | quote }}
app.kubernetes.io/managed-by: {{ .root.Release.Service }}
helm.sh/chart: {{ printf "%s-%s" .root.Chart.Name .root.Chart.Version }}
{{- end }}

{{- define "fluxglobe.image" -}}
{{- with .Values.image -}}
{{ .repository }}{{ if .digest }}@{{ .digest }}{{ else }}:{{ .tag | default $.Chart.AppVersion }}{{ end }}
{{- end }}
{{- end }}

{{/* Does the broker want a user and a password? */}}
{{- define "fluxglobe.kafkaHasUser" -}}
{{- if hasPrefix "sasl" .Values.kafka.security }}yes{{ end }}
{{- end }}
